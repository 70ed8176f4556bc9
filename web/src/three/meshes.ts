/** Triangles of the vessel and of what is in it. Plain arrays, z upwards, metres over the lowest point. */

import { range, type SurfaceGrid, sample } from "./grid.ts";
import type { Colouring, Rgb } from "./palette.ts";
import { colour } from "./palette.ts";

/** A vessel of revolution as the page draws it: a cylinder on a cone (or on a flat floor, `cone` = 0). */
export interface Shape {
  radius: number;
  /** Height of the cone, m; 0 for a flat floor. */
  cone: number;
  /** Height of the cylinder from the cone's rim to the eaves, m. */
  cylinder: number;
}

export interface Triangles {
  positions: number[];
  normals: number[];
  colours: number[];
  indices: number[];
}

const TURN = 2 * Math.PI;
const AROUND = 72;
const RINGS = 22;

export const empty = (): Triangles => ({ positions: [], normals: [], colours: [], indices: [] });

/** Height of the vessel's bottom at a distance from the axis. */
export const bottomAt = (shape: Shape, r: number): number => (shape.cone * Math.min(r, shape.radius)) / shape.radius;

interface Colours {
  of: (x: number, y: number) => Rgb;
}

/** Colour of each place of the surface by what is asked, and the numbers at both ends of the scale. */
export function surfaceColours(grid: SurfaceGrid, by: Colouring): Colours & { low: number; high: number } {
  if (by === "seen") {
    const seen = grid.heights.map((height, i) => (height === null ? null : (grid.seen?.[i] ?? true) ? 1 : 0));
    return { low: 0, high: 1, of: (x, y) => colour("seen", (sample(grid, seen, x, y) ?? 0) > 0.5 ? 1 : 0) };
  }
  const values = by === "height" ? grid.heights : grid.std;
  const [low, high] = range(values);
  const span = Math.max(high - low, by === "height" ? 0.02 : 0.001);
  return { low, high, of: (x, y) => colour(by, ((sample(grid, values, x, y) ?? low) - low) / span) };
}

/** The content's upper surface, ring by ring from the axis to the wall. */
export function surfaceMesh(grid: SurfaceGrid, shape: Shape, by: Colouring): Triangles {
  const made = empty();
  const colours = surfaceColours(grid, by);
  const height = (x: number, y: number) => feedAt(grid, shape, x, y);
  for (let ring = 0; ring <= RINGS; ring++) {
    const r = (shape.radius * 0.998 * ring) / RINGS;
    for (let step = 0; step <= AROUND; step++) {
      const angle = (TURN * step) / AROUND;
      const [x, y] = [r * Math.cos(angle), r * Math.sin(angle)];
      const d = shape.radius / 24;
      const slopeX = (height(x + d, y) - height(x - d, y)) / (2 * d);
      const slopeY = (height(x, y + d) - height(x, y - d)) / (2 * d);
      vertex(made, [x, y, height(x, y)], unit(-slopeX, -slopeY, 1), colours.of(x, y));
    }
  }
  strips(made, RINGS, AROUND);
  return made;
}

/** Height of the content at (x, y), never below the vessel's bottom. */
function feedAt(grid: SurfaceGrid, shape: Shape, x: number, y: number): number {
  const r = Math.hypot(x, y);
  const back = r > shape.radius ? shape.radius / r : 1;
  const bottom = bottomAt(shape, r);
  return Math.max(bottom, sample(grid, grid.heights, x * back, y * back) ?? bottom);
}

/** The content's side along the wall, down over the cone to the vertex. */
export function bodyMesh(grid: SurfaceGrid, shape: Shape, tint: Rgb): Triangles {
  const made = empty();
  for (let ring = 0; ring <= 2; ring++) {
    for (let step = 0; step <= AROUND; step++) {
      const angle = (TURN * step) / AROUND;
      const [c, s] = [Math.cos(angle), Math.sin(angle)];
      const top = feedAt(grid, shape, shape.radius * 0.998 * c, shape.radius * 0.998 * s);
      const [r, z] = [
        [shape.radius, top],
        [shape.radius, Math.min(top, shape.cone)],
        [0, 0],
      ][ring] as [number, number];
      const tilt = ring === 0 ? 0 : -0.6;
      vertex(made, [r * 0.997 * c, r * 0.997 * s, z], unit(c, s, tilt), tint);
    }
  }
  strips(made, 2, AROUND);
  return made;
}

/** The vessel's wall from angle `from` to `to`, with its cone. */
export function vesselMesh(shape: Shape, from: number, to: number, tint: Rgb): Triangles {
  const made = empty();
  const rows: [number, number][] = [
    [shape.radius, shape.cone + shape.cylinder],
    [shape.radius, shape.cone],
    [0, 0],
  ];
  const steps = AROUND / 2;
  for (const [r, z] of rows) {
    for (let step = 0; step <= steps; step++) {
      const angle = from + ((to - from) * step) / steps;
      vertex(made, [r * Math.cos(angle), r * Math.sin(angle), z], unit(-Math.cos(angle), -Math.sin(angle), 0.15), tint);
    }
  }
  strips(made, 2, steps);
  return made;
}

/** Lines that hold the cut-open vessel together: eaves, rim of the cone, the two cut edges. Pairs of points. */
export function outline(shape: Shape, from: number, to: number): number[] {
  const top = shape.cone + shape.cylinder;
  const points: number[] = [];
  for (const z of shape.cone > 0 ? [top, shape.cone] : [top, 0]) {
    for (let step = 0; step < AROUND; step++) {
      for (const angle of [(TURN * step) / AROUND, (TURN * (step + 1)) / AROUND]) {
        points.push(shape.radius * Math.cos(angle), shape.radius * Math.sin(angle), z);
      }
    }
  }
  for (const angle of [from, to]) {
    const [x, y] = [shape.radius * Math.cos(angle), shape.radius * Math.sin(angle)];
    points.push(x, y, top, x, y, shape.cone, x, y, shape.cone, 0, 0, 0);
  }
  return points;
}

function vertex(made: Triangles, position: Rgb, normal: Rgb, tint: Rgb): void {
  made.positions.push(...position);
  made.normals.push(...normal);
  made.colours.push(...tint);
}

/** Two triangles for every quad between neighbouring rows of `steps + 1` vertices. */
function strips(made: Triangles, rows: number, steps: number): void {
  const wide = steps + 1;
  for (let row = 0; row < rows; row++) {
    for (let step = 0; step < steps; step++) {
      const a = row * wide + step;
      made.indices.push(a, a + 1, a + wide, a + 1, a + wide + 1, a + wide);
    }
  }
}

function unit(x: number, y: number, z: number): Rgb {
  const length = Math.hypot(x, y, z);
  return [x / length, y / length, z / length];
}
