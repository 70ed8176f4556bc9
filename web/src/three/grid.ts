/** The surface of the content as square cells: pure numbers, no drawing. Metres; heights upwards over the datum. */

export interface SurfaceGrid {
  /** Cells along a side. */
  side: number;
  /** Half the map's width. */
  reach: number;
  /** Row after row along y, columns along x; null outside the vessel. */
  heights: (number | null)[];
  /** Standard deviation of each height. */
  std: (number | null)[];
  /** Whether the camera saw the cell; null where the server does not say. */
  seen: boolean[] | null;
}

const cellOf = (grid: SurfaceGrid, place: number): number =>
  ((place + grid.reach) / (2 * grid.reach)) * grid.side - 0.5;

/** Value at (x, y), bilinear between the cells that have one; the nearest such cell where none of the four has. */
export function sample(grid: SurfaceGrid, values: (number | null)[], x: number, y: number): number | null {
  const column = cellOf(grid, x);
  const row = cellOf(grid, y);
  const left = Math.floor(column);
  const low = Math.floor(row);
  let sum = 0;
  let weight = 0;
  for (const [dx, dy] of CORNERS) {
    const value = at(grid, values, left + dx, low + dy);
    if (value === null) continue;
    const part = (1 - Math.abs(column - left - dx)) * (1 - Math.abs(row - low - dy));
    sum += part * value;
    weight += part;
  }
  return weight > 1e-6 ? sum / weight : nearest(grid, values, column, row);
}

const CORNERS = [
  [0, 0],
  [1, 0],
  [0, 1],
  [1, 1],
] as const;

function at(grid: SurfaceGrid, values: (number | null)[], column: number, row: number): number | null {
  if (column < 0 || row < 0 || column >= grid.side || row >= grid.side) return null;
  return values[row * grid.side + column] ?? null;
}

function nearest(grid: SurfaceGrid, values: (number | null)[], column: number, row: number): number | null {
  let best: number | null = null;
  let distance = Number.POSITIVE_INFINITY;
  for (let y = 0; y < grid.side; y++) {
    for (let x = 0; x < grid.side; x++) {
      const value = at(grid, values, x, y);
      const away = (x - column) ** 2 + (y - row) ** 2;
      if (value !== null && away < distance) {
        best = value;
        distance = away;
      }
    }
  }
  return best;
}

/** Heights along a line through the axis, from wall to wall: what the section draws. */
export function profile(grid: SurfaceGrid, radius: number, points = 25): number[] {
  return Array.from({ length: points }, (_, index) => {
    const x = radius * ((2 * index) / (points - 1) - 1) * 0.999;
    return sample(grid, grid.heights, x, 0) ?? 0;
  });
}

export function range(values: (number | null)[]): [number, number] {
  const known = values.filter((value): value is number => value !== null && Number.isFinite(value));
  return known.length ? [Math.min(...known), Math.max(...known)] : [0, 1];
}
