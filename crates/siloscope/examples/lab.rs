use siloscope::backproject::*;
use siloscope::locate::*;
use siloscope::*;
use std::io::{BufRead, Read, Write};
// stdin lines: path W H share partners k view threads -> prints pose
fn main() {
    let stdin = std::io::stdin();
    for l in stdin.lock().lines() {
        let l = l.unwrap();
        let w: Vec<&str> = l.split_whitespace().collect();
        let (wd, h): (usize, usize) = (w[1].parse().unwrap(), w[2].parse().unwrap());
        let mut b = Vec::new();
        std::fs::File::open(w[0]).unwrap().read_to_end(&mut b).unwrap();
        let d: Vec<f64> = b.chunks_exact(8).map(|c| f64::from_le_bytes(c.try_into().unwrap())).collect();
        let s = wd as f64 / 640.0;
        let cam = Camera {
            width: wd,
            height: h,
            fx: 570.3 * s,
            fy: 570.3 * s,
            cx: (wd as f64 - 1.0) / 2.0,
            cy: (h as f64 - 1.0) / 2.0,
            distortion: Distortion::None,
        };
        let set = Settings {
            share: w[3].parse().unwrap(),
            partners: w[4].parse().unwrap(),
            neighbours: w[5].parse().unwrap(),
            threads: w[6].parse().unwrap(),
            ..Default::default()
        };
        let im = DepthImage::new(Depths::Double(&d), &cam, None, 1.0, None).unwrap();
        let (p, t) = locate_in_image(&im, &set).unwrap();
        let (p, t) = if w.len() > 7 {
            let mut best = t;
            let mut pp = p;
            for _ in 0..9 {
                let (q, u) = locate_in_image(&im, &set).unwrap();
                pp = q;
                for i in 0..u.len() {
                    best[i] = best[i].min(u[i])
                }
            }
            (pp, best)
        } else {
            (p, t)
        };
        println!("{:?} {:?}", p, t);
        std::io::stdout().flush().unwrap();
    }
}
