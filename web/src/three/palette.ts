/** Colour scales of the surface, as [red, green, blue] in 0…1. Lightness rises along each, so they read without hue. */

export type Rgb = [number, number, number];

const HEIGHT = ["#5b3a1f", "#8f5a22", "#c2832e", "#e0ad4d", "#f4dc9c"];
const DEVIATION = ["#2c6e5a", "#6ba583", "#d9cfa0", "#d98a5b", "#b3423a"];
const SEEN = ["#6b7280", "#dca343"];

export type Colouring = "height" | "deviation" | "seen";

const SCALES: Record<Colouring, Rgb[]> = {
  height: HEIGHT.map(rgb),
  deviation: DEVIATION.map(rgb),
  seen: SEEN.map(rgb),
};

function rgb(hex: string): Rgb {
  const value = Number.parseInt(hex.slice(1), 16);
  return [(value >> 16) / 255, ((value >> 8) & 255) / 255, (value & 255) / 255];
}

export function colour(scale: Colouring, fraction: number): Rgb {
  const stops = SCALES[scale];
  const place = Math.min(1, Math.max(0, Number.isFinite(fraction) ? fraction : 0)) * (stops.length - 1);
  const below = Math.min(stops.length - 2, Math.floor(place));
  const [a, b] = [stops[below] ?? [0, 0, 0], stops[below + 1] ?? [0, 0, 0]];
  const part = place - below;
  return [0, 1, 2].map((i) => (a[i] ?? 0) + part * ((b[i] ?? 0) - (a[i] ?? 0))) as Rgb;
}

export const css = ([r, g, b]: Rgb): string =>
  `rgb(${Math.round(r * 255)} ${Math.round(g * 255)} ${Math.round(b * 255)})`;
