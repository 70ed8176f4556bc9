/** What a silo's answer means for its drawing: pure functions. */
import type { Alert, Silo, Vessel } from "../data/answers.ts";
import type { Shape } from "../three/meshes.ts";
import { UNKNOWN } from "./section-geometry.ts";

/** Whether the reading is older than the silo allows, by the page's own clock: so it also ages without a link. */
export function isLate(silo: Silo, now: number): boolean {
  return silo.now.time !== null && now - Date.parse(silo.now.time) > silo.stale_after_s * 1000;
}

/** The shape that is drawn for a vessel: what is not known of it is as in a common silo of its radius. */
export function shapeOf(vessel: Vessel | null): Shape {
  if (vessel === null || vessel.radius_m === null) return UNKNOWN;
  const radius = vessel.radius_m;
  const between = (low: number | null, high: number | null, usual: number) =>
    low === null || high === null || low <= high ? usual : low - high;
  const { top_z_m, cylinder_bottom_z_m, bottom_z_m, bottom } = vessel;
  const cylinder = between(cylinder_bottom_z_m, top_z_m, (UNKNOWN.cylinder / UNKNOWN.radius) * radius);
  const cone =
    bottom === "flat" ? 0 : between(bottom_z_m, cylinder_bottom_z_m, (UNKNOWN.cone / UNKNOWN.radius) * radius);
  return { radius, cylinder, cone };
}

/** By how much heights over the surface's datum must be raised to be heights over the vessel's lowest point, m. */
export function raised(vessel: Vessel): number {
  return vessel.bottom_z_m === null || vessel.datum_z_m === null ? 0 : vessel.bottom_z_m - vessel.datum_z_m;
}

export function toneOf(silo: Silo, alerts: Alert[]): "good" | "low" | "critical" | "unknown" {
  if (silo.now.fill_fraction === null) return "unknown";
  const kinds = alerts.filter((alert) => alert.silo === silo.id && alert.resolved === null).map((alert) => alert.kind);
  if (kinds.includes("critical")) return "critical";
  return kinds.includes("low") ? "low" : "good";
}
