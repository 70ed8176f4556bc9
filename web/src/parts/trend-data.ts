/** What the trend draws, from readings: pure functions. Times in seconds, as uPlot has them. */

export interface Point {
  time: number;
  value: number;
  std: number | null;
}

export interface Span {
  from: number;
  to: number;
}

/** Columns of uPlot: times, value, upper and lower edge of the band of two deviations, forecast and its edges. */
export type Columns = [number[], ...(number | null)[][]];

export interface Outlook {
  /** Use per second, in the trend's unit, positive while the silo empties; its standard deviation. */
  rate: number;
  rateStd: number;
}

/** Stretches longer than `most` seconds without a reading, from the first one to `until`. */
export function gaps(points: Point[], most: number, until: number): Span[] {
  const found: Span[] = [];
  let before = points[0]?.time ?? until;
  for (const time of [...points.slice(1).map((point) => point.time), until]) {
    if (time - before > most) found.push({ from: before, to: time });
    before = time;
  }
  return found;
}

/** uPlot's columns, with an empty row in the middle of every gap, so that no line bridges it. */
export function columns(points: Point[], holes: Span[], outlook: Outlook | null, until: number): Columns {
  const rows: (number | null)[][] = [];
  const ends = new Set(holes.map((hole) => hole.from));
  for (const { time, value, std } of points) {
    const wide = 2 * (std ?? 0);
    rows.push([time, value, value + wide, Math.max(0, value - wide), null, null, null]);
    const hole = ends.has(time) ? holes.find((one) => one.from === time) : undefined;
    if (hole) rows.push([(hole.from + hole.to) / 2, null, null, null, null, null, null]);
  }
  const last = points.at(-1);
  if (last && outlook) rows.push(...ahead(last, outlook, until));
  const column = (i: number) => rows.map((row) => row[i] ?? null);
  return [column(0) as number[], column(1), column(2), column(3), column(4), column(5), column(6)];
}

const STEPS = 24;

function ahead(last: Point, { rate, rateStd }: Outlook, until: number): (number | null)[][] {
  // The first row lies a second behind the last reading, so that times rise.
  const start = last.time + 1;
  return Array.from({ length: STEPS + 1 }, (_, step) => {
    const time = start + ((until - start) * step) / STEPS;
    const spread = 2 * Math.hypot(last.std ?? 0, rateStd * (time - last.time));
    const value = last.value - rate * (time - last.time);
    return [time, null, null, null, ...[value, value + spread, value - spread].map(floor)];
  });
}

const floor = (value: number): number => Math.max(0, value);

/** The last point that still holds on a given day, day by day: the table that says the trend in words. */
export function daily(points: Point[], dayOf: (milliseconds: number) => string): { day: string; point: Point }[] {
  const found = new Map<string, Point>();
  for (const point of points) found.set(dayOf(point.time * 1000), point);
  return [...found].map(([day, point]) => ({ day, point })).reverse();
}

export interface Use extends Span {
  amount: number;
}

/** What was used between each two of some rising times: the sum of falls between readings, a fall across a border shared
 * out by time; rises and gaps count as none. Stretches without two readings are left out. */
export function uses(points: Point[], holes: Span[], borders: number[]): Use[] {
  const found = new Map<number, number>();
  const open = new Set(holes.map((hole) => hole.from));
  let slot = 0;
  points.slice(1).forEach((point, i) => {
    const before = points[i];
    if (!before || open.has(before.time)) return;
    const fall = Math.max(0, before.value - point.value);
    while (slot < borders.length - 1 && (borders[slot + 1] ?? 0) <= before.time) slot += 1;
    for (let at = slot; at < borders.length - 1; at += 1) {
      const inside = Math.min(point.time, borders[at + 1] ?? 0) - Math.max(before.time, borders[at] ?? 0);
      if (inside > 0) found.set(at, (found.get(at) ?? 0) + (fall * inside) / (point.time - before.time));
      if ((borders[at + 1] ?? 0) >= point.time) break;
    }
  });
  return [...found].map(([at, amount]) => ({ from: borders[at] ?? 0, to: borders[at + 1] ?? 0, amount }));
}
