/** The silo's section, drawn to its own proportions, filled to its content. Decoration: the card says it in words. */
import type { Shape } from "../three/meshes.ts";
import { heightOf } from "./section-geometry.ts";

interface Props {
  shape: Shape;
  /** Fraction of the volume; null where nothing is known. */
  fill: number | null;
  /** Heights of the surface from wall to wall over the lowest point, m; a level line where there is none. */
  profile?: number[] | null;
  tone: "good" | "low" | "critical" | "unknown";
  stale?: boolean;
}

const WIDE = 72;
const TALL = 108;
const ROOF = 0.34;

export function Section({ shape, fill, profile, tone, stale }: Props) {
  const whole = shape.cone + shape.cylinder + ROOF * shape.radius;
  const legs = 0.1 * whole;
  const scale = Math.min((WIDE - 8) / (2 * shape.radius), (TALL - 8) / (whole + legs));
  const x = (metres: number) => round(WIDE / 2 + metres * scale);
  const y = (metres: number) => round(TALL - 4 - (metres + legs) * scale);
  const eaves = shape.cone + shape.cylinder;
  const r = shape.radius;
  const vessel = `M${x(-r)} ${y(eaves)}V${y(shape.cone)}L${x(-0.1 * r)} ${y(0)}H${x(0.1 * r)}L${x(r)} ${y(shape.cone)}V${y(eaves)}`;
  const surface = fill === null ? [] : (profile ?? [0, 0].fill(heightOf(shape, fill)));
  const top = surface.map((height, i) => `${x(r * ((2 * i) / (surface.length - 1) - 1))} ${y(height)}`);
  const clip = `clip-${Math.round(scale * 1000)}-${Math.round(shape.cone * 1000)}-${Math.round(shape.cylinder * 1000)}`;
  return (
    <svg class={`section ${tone}${stale ? " stale" : ""}`} viewBox={`0 0 ${WIDE} ${TALL}`} aria-hidden="true">
      <clipPath id={clip}>
        <path d={`${vessel}Z`} />
      </clipPath>
      <path class="legs" d={`M${x(-r)} ${y(shape.cone)}V${y(-legs)}M${x(r)} ${y(shape.cone)}V${y(-legs)}`} />
      <path class="inside" d={`${vessel}Z`} />
      {fill !== null && (
        <path class="feed" clip-path={`url(#${clip})`} d={`M${top.join("L")}L${x(r)} ${y(0)}L${x(-r)} ${y(0)}Z`} />
      )}
      {fill !== null && <path class="surface" clip-path={`url(#${clip})`} d={`M${top.join("L")}`} />}
      <path
        class="roof"
        d={`M${x(-1.06 * r)} ${y(eaves)}L${x(0)} ${y(eaves + ROOF * r)}L${x(1.06 * r)} ${y(eaves)}Z`}
      />
      <path class="wall" d={vessel} />
    </svg>
  );
}

const round = (value: number): number => Math.round(value * 10) / 10;
