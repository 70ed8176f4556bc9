/** Geometry of the drawn section: pure functions, metres in, metres out. */
import type { Shape } from "../three/meshes.ts";

/** Volume of the vessel up to a height over its lowest point. */
export function volumeAt(shape: Shape, height: number): number {
  const { radius, cone, cylinder } = shape;
  const area = Math.PI * radius * radius;
  const h = Math.min(Math.max(0, height), cone + cylinder);
  if (h <= cone) return cone > 0 ? (area * cone * (h / cone) ** 3) / 3 : 0;
  return (area * cone) / 3 + area * (h - cone);
}

/** Height to which a fraction of the vessel's volume reaches, as if its surface were level. */
export function heightOf(shape: Shape, fraction: number): number {
  const { radius, cone } = shape;
  const area = Math.PI * radius * radius;
  const wanted = Math.min(1, Math.max(0, fraction)) * volumeAt(shape, Number.POSITIVE_INFINITY);
  const inCone = (area * cone) / 3;
  if (wanted <= inCone && cone > 0) return cone * Math.cbrt(wanted / inCone);
  return cone + (wanted - inCone) / area;
}

/** The silo's shape where nothing is known of it: drawn, never measured with. */
export const UNKNOWN: Shape = { radius: 1.4, cone: 1.3, cylinder: 3.6 };
