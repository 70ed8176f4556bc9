import assert from "node:assert/strict";
import { test } from "node:test";
import { backoff, type Event, parser } from "../src/data/stream.ts";
import { aimOf, GOOD, turns } from "../src/parts/aim.ts";
import { heightOf, volumeAt } from "../src/parts/section-geometry.ts";
import { columns, daily, gaps, uses } from "../src/parts/trend-data.ts";
import { link, parse } from "../src/router.ts";
import { profile, type SurfaceGrid, sample } from "../src/three/grid.ts";
import { bodyMesh, surfaceMesh } from "../src/three/meshes.ts";
import { colour } from "../src/three/palette.ts";
import { branches, inForce, within } from "../src/views/places.ts";

const close = (found: number | null, wanted: number, within = 1e-9) =>
  assert.ok(found !== null && Math.abs(found - wanted) <= within, `${found} is not ${wanted}`);

/** A plane z = 1 + 0.2 x over a round vessel of radius 1. */
function plane(): SurfaceGrid {
  const side = 32;
  const middle = (cell: number) => ((cell + 0.5) * 2) / side - 1;
  const heights = Array.from({ length: side * side }, (_, i) => {
    const [x, y] = [middle(i % side), middle(Math.floor(i / side))];
    return Math.hypot(x, y) <= 1 ? 1 + 0.2 * x : null;
  });
  return { side, reach: 1, heights, std: heights.map((height) => height && 0.01), seen: heights.map(() => true) };
}

test("a surface is bilinear between its cells, and goes on to the wall", () => {
  const grid = plane();
  close(sample(grid, grid.heights, 0.31, -0.2), 1.062, 1e-12);
  close(sample(grid, grid.heights, 0.999, 0), 1.2, 0.01);
  close(profile(grid, 1, 3)[1] ?? null, 1, 1e-12);
});

test("the surface's mesh lies on the surface, its normals stand on it", () => {
  const { positions, normals, indices } = surfaceMesh(plane(), { radius: 1, cone: 0.5, cylinder: 2 }, "height");
  for (let i = 0; i < positions.length; i += 300) {
    const x = positions[i] ?? 0;
    close(positions[i + 2] ?? 0, 1 + 0.2 * x, 0.012);
  }
  close((normals[0] ?? 0) / (normals[2] ?? 1), -0.2, 1e-6);
  assert.ok(Math.max(...indices) < positions.length / 3);
});

test("the content's side ends at the vertex and never lies above its surface", () => {
  const { positions } = bodyMesh(plane(), { radius: 1, cone: 0.5, cylinder: 2 }, [1, 1, 1]);
  const heights = positions.filter((_, i) => i % 3 === 2);
  assert.equal(Math.min(...heights), 0);
  assert.ok(Math.max(...heights) <= 1.21);
});

test("colours rise along their scale and stop at its ends", () => {
  const lightness = (fraction: number) => colour("height", fraction).reduce((sum, part) => sum + part, 0);
  assert.ok(lightness(0.2) < lightness(0.5) && lightness(0.5) < lightness(0.9));
  assert.deepEqual(colour("height", 7), colour("height", 1));
});

test("the height of a fraction holds that fraction of the volume", () => {
  for (const shape of [
    { radius: 1.4, cone: 1.3, cylinder: 3.6 },
    { radius: 2, cone: 0, cylinder: 5 },
  ]) {
    const whole = volumeAt(shape, 99);
    for (const fraction of [0, 0.03, 0.2, 0.7, 1])
      close(volumeAt(shape, heightOf(shape, fraction)) / whole, fraction, 1e-12);
  }
});

test("the turn is towards where the axis goes", () => {
  // Axis direction X = (sin 5°, 0, cos 5°): it leaves the picture to the right, so the camera turns to the right.
  const aim = aimOf(0, -(5 * Math.PI) / 180);
  close(aim.off, (5 * Math.PI) / 180, 1e-9);
  assert.deepEqual(
    turns(aim).map((turn) => turn.way),
    ["right"],
  );
  const low = aimOf((10 * Math.PI) / 180, (4 * Math.PI) / 180);
  assert.deepEqual(
    turns(low).map((turn) => turn.way),
    ["down", "left"],
  );
  assert.deepEqual(turns(aimOf(GOOD / 2, GOOD / 2)), []);
});

const point = (time: number, value: number) => ({ time, value, std: 0.1 });

test("gaps are where readings fail to come, also at the end", () => {
  const points = [point(0, 5), point(10, 4), point(40, 3)];
  assert.deepEqual(gaps(points, 15, 45), [{ from: 10, to: 40 }]);
  assert.deepEqual(gaps(points, 15, 80), [
    { from: 10, to: 40 },
    { from: 40, to: 80 },
  ]);
});

test("no line bridges a gap, the band is two deviations wide, the forecast falls", () => {
  const points = [point(0, 5), point(10, 4), point(40, 3)];
  const [times, values, high, low, ahead] = columns(points, [{ from: 10, to: 40 }], { rate: 0.1, rateStd: 0.01 }, 60);
  assert.deepEqual(values?.slice(0, 4), [5, 4, null, 3]);
  close(high?.[0] ?? 0, 5.2);
  close(low?.[0] ?? 0, 4.8);
  close(ahead?.at(-1) ?? 0, 1);
  assert.ok(times.every((time, i) => i === 0 || time > (times[i - 1] ?? 0)));
});

test("use counts falls, not refills and not gaps", () => {
  const points = [point(0, 5), point(10, 4), point(20, 9), point(30, 8.5), point(300, 1)];
  assert.deepEqual(uses(points, [{ from: 30, to: 300 }], [0, 100, 200]), [{ from: 0, to: 100, amount: 1.5 }]);
});

test("use is counted in the day in which it was, a fall over midnight in both", () => {
  const points = [point(-50, 8), point(0, 7), point(90, 6), point(130, 4), point(190, 3), point(250, 3)];
  assert.deepEqual(uses(points, [], [0, 100, 200]), [
    { from: 0, to: 100, amount: 1.5 },
    { from: 100, to: 200, amount: 2.5 },
  ]);
});

test("a day's last reading stands for the day", () => {
  const rows = daily([point(0, 5), point(10, 4), point(100_000, 3)], (time) => String(Math.floor(time / 86_400_000)));
  assert.deepEqual(
    rows.map(({ day, point }) => [day, point.value]),
    [
      ["1", 3],
      ["0", 4],
    ],
  );
});

test("events are read whatever pieces they come in", () => {
  const text = ': hello\n\nid: 7\nevent: change\ndata: {"a":\ndata: 1}\n\nid: 8\r\ndata: x\r\n\r\n';
  for (const size of [1, 3, 1000]) {
    const found: Event[] = [];
    const parse_ = parser((event) => found.push(event));
    for (let i = 0; i < text.length; i += size) parse_(text.slice(i, i + size));
    assert.deepEqual(found, [
      { id: "7", type: "change", data: '{"a":\n1}' },
      { id: "8", type: "message", data: "x" },
    ]);
  }
});

test("an unfinished event is not told", () => {
  const found: Event[] = [];
  parser((event) => found.push(event))("id: 1\ndata: x\n");
  assert.deepEqual(found, []);
});

test("tries are made ever more rarely, at least every 38 s", () => {
  assert.equal(backoff(0, 0), 500);
  assert.equal(backoff(20, 1), 37_500);
});

test("addresses and views belong together", () => {
  assert.deepEqual(parse(link.silo("a/b ü", "rules")), { view: "silo", silo: "a/b ü", tab: "rules" });
  assert.deepEqual(parse(link.install("cam 1")), { view: "install", camera: "cam 1" });
  assert.deepEqual(parse(link.silos("north")), { view: "silos", place: "north" });
  assert.deepEqual(parse(""), { view: "silos", place: null });
  assert.deepEqual(parse("#/nonsense"), { view: "silos", place: null });
  assert.deepEqual(parse("#/silos/%E0%A4%A"), { view: "silos", place: null });
});

const PLACES = [
  { id: "farm", parent: "mill", kind: "farm", name: "Farm", zone: null, version: 1 },
  { id: "mill", parent: null, kind: "mill", name: "Mill", zone: null, version: 1 },
  { id: "lost", parent: "not-shown", kind: "farm", name: "Lost", zone: null, version: 1 },
];

test("the tree has every place once, also one whose parent may not be seen, and ends on a circle", () => {
  const tree = branches(PLACES, []);
  assert.deepEqual(
    tree.map((branch) => branch.place.id),
    ["lost", "mill"],
  );
  assert.deepEqual(
    tree[1]?.below.map((branch) => branch.place.id),
    ["farm"],
  );
  assert.ok(within(PLACES, "farm", "mill"));
  assert.ok(!within([{ id: "a", parent: "a", kind: "", name: "", zone: null, version: 1 }], "a", "b"));
});

test("of rules of one kind the nearest holds", () => {
  const rule = (id: string, kind: string, silo: string | null, place: string | null) => ({
    ...{
      id,
      kind,
      silo,
      place,
      level: 0.2,
      clear: 0.25,
      delay_s: 0,
      enabled: true,
      unit: "fraction",
      meaning: "",
      channels: [],
      version: 1,
    },
  });
  const rules = [
    rule("site", "low", null, null),
    rule("mill", "low", null, "mill"),
    rule("farm", "low", null, "farm"),
    rule("own", "low", "a", null),
    rule("other", "critical", "b", null),
    rule("elsewhere", "overfill", null, "lost"),
  ];
  const ids = (id: string, place: string | null) => inForce(rules, { id, place }, PLACES).map((one) => one.id);
  assert.deepEqual(ids("a", "farm"), ["own"]);
  assert.deepEqual(ids("c", "farm"), ["farm"]);
  assert.deepEqual(ids("c", "mill"), ["mill"]);
  assert.deepEqual(ids("c", null), ["site"]);
});
