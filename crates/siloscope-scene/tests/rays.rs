//! Rays end on a surface, and nothing lies before it: any silo, any feed, any wall, any direction.

use proptest::prelude::*;
use siloscope::Vec3;
use siloscope_scene::feed_shape::{Base, Lumps, Shape};
use siloscope_scene::{
    Bend, Bottom, Corrugation, Courses, Dent, Feed, Film, Label, Rathole, Relief, Seams, Silo, SiloWorld, Wall, World,
    volume,
};

fn silos() -> impl Strategy<Value = Silo> {
    let lengths = (0.5..3.0f64, 0.0..5.0f64, 0.3..3.0f64, -1.0..0.0f64);
    (lengths, 0..5u32, 0.2..0.8f64, -3.1..3.1f64, 0.9..1.05f64).prop_map(|(lengths, kind, share, azimuth, ring)| {
        let (radius, above, cone_height, top) = lengths;
        let floor = match kind {
            0 => Bottom::Cone,
            1 => Bottom::Oblique,
            2 => Bottom::TwoStage { waist: share * radius, depth: (1.0 - share) * cone_height },
            3 => Bottom::Pyramid { azimuth },
            _ => Bottom::Flat,
        };
        let aside = if floor == Bottom::Oblique { share * radius } else { 0.0 };
        let cylinder_height = above - top;
        let stepped = cylinder_height > 0.5 && share > 0.5;
        Silo {
            radius,
            cylinder_height,
            cone_height: if floor == Bottom::Flat { 0.0 } else { cone_height },
            top,
            floor,
            courses: if stepped { vec![[share * cylinder_height, ring * radius]] } else { vec![] },
            outlet_offset: [aside * azimuth.cos(), aside * azimuth.sin()],
            ..Silo::default()
        }
    })
}

fn bases() -> impl Strategy<Value = Base> {
    prop_oneof![
        Just(Base::Flat),
        Just(Base::Gaussian),
        (0.2..1.5f64, 0.02..0.5f64, 0.0..1.0f64, 0.01..0.1f64)
            .prop_map(|(a, tip, depth, edge)| Base::Crater(a, tip, depth, edge)),
        (-1.5..1.5f64, 0.02..0.5f64).prop_map(|(tangent, tip)| Base::Conical(tangent, tip)),
    ]
}

/// Base, centre, tilt, lumps and rathole for a silo of radius 1.
type Plan = (Base, [f64; 2], [f64; 2], Option<(f64, f64, u64)>, Option<Rathole>);

fn shapes() -> impl Strategy<Value = Plan> {
    let pair = |size: f64| proptest::array::uniform2(-size..size);
    let lumps = proptest::option::of((0.01..0.2f64, 0.1..1.0f64, 0..1000u64));
    let hole = (pair(0.6), 0.1..0.5f64, 0.1..2.0f64);
    let hole = proptest::option::of(hole.prop_map(|(centre, radius, depth)| Rathole { centre, radius, depth }));
    (bases(), pair(0.5), pair(0.5), lumps, hole)
}

fn shape_for(radius: f64, (base, centre, tilt, lumps, hole): Plan) -> Shape {
    Shape {
        radius,
        base,
        centre: centre.map(|x| x * radius),
        tilt,
        lumps: lumps.and_then(|(height, pitch, seed)| Lumps::new(height * radius, pitch * radius, radius, seed).ok()),
        ratholes: hole
            .into_iter()
            .map(|hole| Rathole { centre: hole.centre.map(|x| x * radius), radius: hole.radius * radius, ..hole })
            .collect(),
    }
}

fn directions() -> impl Strategy<Value = Vec3> {
    (-1.0..1.0f64, -1.0..1.0f64, -0.5..1.0f64)
        .prop_map(|(x, y, z)| Vec3::new(x, y, z))
        .prop_filter("a direction", |ray| ray.norm() > 0.1)
}

/// A place in the silo at the camera's height.
fn origin_in(silo: &Silo, share: f64, azimuth: f64) -> Vec3 {
    let widest = silo.narrowest();
    Vec3::new(share * widest * azimuth.cos(), share * widest * azimuth.sin(), 0.0)
}

/// How far a point lies over the bottom, straight up.
fn over_bottom(silo: &Silo, p: &Vec3) -> f64 {
    let r = p.xy().norm().max(1e-300);
    silo.apex() - silo.floor_height(r, (p.x / r, p.y / r)) - p.z
}

/// How far a point is inside the silo's air; negative behind a surface.
fn clearance(silo: &Silo, feed: Option<&Feed>, p: &Vec3) -> f64 {
    let wall = silo.radius - p.xy().norm();
    let above = feed.map_or(f64::INFINITY, |feed| feed.depth_below(p));
    wall.min(over_bottom(silo, p)).min(above)
}

/// How far a point is inside an uneven wall or, where no unevenness goes on below the rim, over the bottom.
fn gap(wall: &Wall, p: &Vec3) -> f64 {
    let silo = &wall.silo;
    let space = |p: &Vec3, perfect: f64, on_cylinder: bool| {
        let angle = p.y.atan2(p.x);
        let oval = 1.0 + wall.ovality * (2.0 * (angle - wall.ovality_azimuth)).cos();
        let relief = wall.relief.jet(angle, p.z, on_cylinder)[0];
        perfect * oval + perfect / silo.radius * relief - p.xy().norm()
    };
    let share = (p.z - silo.bottom()) / silo.cone_height;
    let [x, y] = if silo.floor == Bottom::Oblique { silo.outlet_offset } else { [0.0; 2] };
    let ledge = p.xy().norm() > silo.radius;
    match silo.floor {
        Bottom::Cone | Bottom::Oblique if p.z < silo.bottom() => space(p, silo.radius, true),
        Bottom::Cone | Bottom::Oblique => {
            space(&(p - Vec3::new(share * x, share * y, 0.0)), silo.slope() * (silo.apex() - p.z), false)
        }
        _ if p.z < silo.bottom() => {
            // a floor is a surface from above too: a hit may lie a rounding error over it
            let below = if ledge { silo.bottom() - p.z } else { over_bottom(silo, p) };
            space(p, silo.radius, true).min(below)
        }
        _ if ledge => 0.0,
        Bottom::Pyramid { .. } => over_bottom(silo, p).min(space(p, silo.radius, true)),
        _ => over_bottom(silo, p),
    }
}

fn rough(silo: &Silo) -> Relief {
    let r = silo.radius;
    Relief {
        radius: r,
        bottom: silo.bottom(),
        top: silo.top,
        corrugation: Some(Corrugation { pitch: 0.076, depth: 0.013 }),
        seams: Some(Seams {
            spacing: 0.7,
            uprights: 5,
            height: 0.003,
            half_width: 0.03,
            bolts: 20,
            bolt_height: 0.008,
            bolt_radius: 0.02,
        }),
        dents: vec![Dent { azimuth: 1.0, z: silo.bottom(), radius: 0.4 * r, height: 0.03 * r }],
        films: vec![Film { from: 0.3, to: silo.apex() - 0.1, thickness: 0.02 * r, lobes: 3, azimuth: 0.2 }],
        courses: Courses(silo.courses.iter().map(|[end, radius]| [silo.top + end, radius - r]).collect()),
        bend: Some(Bend { depth: 0.01 * r, azimuth: 0.9 }),
    }
}

proptest! {
    #[test]
    fn a_perfect_silo_is_hit_first_and_exactly(
        silo in silos(), plan in shapes(), level in 0.0..0.9f64,
        share in 0.0..0.9f64, azimuth in -3.1..3.1f64, ray in directions(),
    ) {
        let feed = Feed::fill(&silo, shape_for(silo.radius, plan), level).ok();
        let origin = origin_in(&silo, share, azimuth);
        let world = SiloWorld { silo: silo.clone(), wall: None, feed, clutter: vec![] };
        prop_assume!(world.check_camera(&origin).is_ok());
        let Some(hit) = world.cast(&origin, &ray) else {
            prop_assert!(ray.z < 0.0, "only rays that look up leave the silo");
            return Ok(());
        };
        let at = |t: f64| clearance(&silo, world.feed.as_ref(), &(origin + ray * t));
        prop_assert!(hit.t > 0.0 && at(hit.t).abs() < 1e-9, "{:?} is {} off", hit, at(hit.t));
        prop_assert!((1..1000).all(|i| at(hit.t * f64::from(i) / 1000.0) > -1e-9));
        prop_assert!(hit.normal.dot(&ray) <= 1e-9 && (hit.normal.norm() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn an_uneven_wall_is_hit_first_and_exactly(
        silo in silos(), share in 0.0..0.7f64, azimuth in -3.1..3.1f64, ray in directions(), ovality in 0.0..0.05f64,
    ) {
        let Ok(wall) = Wall::new(&silo, rough(&silo), ovality, 0.4) else { return Err(TestCaseError::reject("too rough")) };
        let origin = origin_in(&silo, share, azimuth);
        let world = SiloWorld { silo: silo.clone(), wall: Some(wall.clone()), feed: None, clutter: vec![] };
        prop_assume!(world.check_camera(&origin).is_ok());
        let Some(hit) = world.cast(&origin, &ray) else {
            prop_assert!(ray.z < 0.0);
            return Ok(());
        };
        let at = |t: f64| gap(&wall, &(origin + ray * t));
        prop_assert!(at(hit.t).abs() < 1e-9, "{:?} is {} off", hit, at(hit.t));
        prop_assert!((1..2000).all(|i| at(hit.t * f64::from(i) / 2000.0) > -1e-9));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn volume_is_between_nothing_and_the_silo_and_grows_with_the_level(
        silo in silos(), plan in shapes(), level in 0.0..0.9f64,
    ) {
        let shape = shape_for(silo.radius, plan);
        let fill = |level: f64| Feed::fill(&silo, shape.clone(), level).map(|feed| volume::content(&feed));
        let (low, high) = (fill(level), fill(level + 0.1));
        let (Ok(low), Ok(high)) = (low, high) else { return Err(TestCaseError::reject("no feed")) };
        prop_assert!(low.volume >= 0.0 && high.volume <= silo.capacity() * (1.0 + 1e-9));
        prop_assert!(low.volume <= high.volume * (1.0 + 1e-9));
    }
}

#[test]
fn the_vertex_itself_is_the_cone() {
    let silo = Silo { radius: 1.0, cylinder_height: 2.0, cone_height: 1.0, ..Silo::default() };
    let world = SiloWorld { silo: silo.clone(), wall: None, feed: None, clutter: vec![] };
    let hit = world.cast(&Vec3::zeros(), &Vec3::z()).map(|hit| (hit.t, hit.label));
    assert_eq!(hit, Some((3.0, Label::Cone)));
    let relief = Relief { dents: vec![], films: vec![], seams: None, bend: None, ..rough(&silo) };
    let wall = Wall::new(&silo, relief, 0.0, 0.0).ok();
    let hit = SiloWorld { wall, ..world }.cast(&Vec3::zeros(), &Vec3::z()).map(|hit| (hit.t, hit.label));
    assert!(matches!(hit, Some((t, Label::Cone)) if (t - 3.0).abs() < 1e-9), "{hit:?}");
}

/// The hit is a rounding error above the floor, where a point belongs to the cylinder.
#[test]
fn a_flat_floor_is_hit_from_straight_above() {
    let silo = Silo {
        radius: 1.8172019128757428,
        cylinder_height: 0.5627268940959572,
        cone_height: 0.0,
        floor: Bottom::Flat,
        ..Silo::default()
    };
    let wall = Wall::new(&silo, rough(&silo), 0.0, 0.4).ok();
    let world = SiloWorld { silo: silo.clone(), wall: wall.clone(), feed: None, clutter: vec![] };
    let ray = Vec3::new(0.0, 0.0, 0.5468956693066542);
    let off = wall.zip(world.cast(&Vec3::zeros(), &ray)).map(|(wall, hit)| gap(&wall, &(ray * hit.t)).abs());
    assert!(off.is_some_and(|off| off < 1e-9), "{off:?}");
}
