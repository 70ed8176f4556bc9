/** From a camera's pose to how its lens must be turned: pure functions. Angles in radians. */

export interface Aim {
  /** Angle between the camera's view and the silo's axis. */
  off: number;
  /** Turn to the right as seen in the picture; negative is to the left. */
  right: number;
  /** Turn downwards in the picture; negative is upwards. */
  down: number;
}

/**
 * The turn that makes the camera look along the axis.
 *
 * `r_x`, `r_y` are the pose's angles (Eq. 6 of the paper): the axis in the camera frame is X = (-sin r_y,
 * sin r_x cos r_y, cos r_x cos r_y), x to the right and y down in the picture. The camera is turned to where the axis
 * goes to.
 */
export function aimOf(r_x: number, r_y: number): Aim {
  const x = -Math.sin(r_y);
  const y = Math.sin(r_x) * Math.cos(r_y);
  const z = Math.cos(r_x) * Math.cos(r_y);
  return { off: Math.acos(Math.min(1, z)), right: Math.atan2(x, z), down: Math.atan2(y, z) };
}

/** A view this far off the axis sees the wall on all sides. */
export const GOOD = (3 * Math.PI) / 180;

/** Ways to turn, the larger one first; those within the tolerance are left out. */
export function turns({ off, right, down }: Aim): { way: "right" | "left" | "down" | "up"; by: number }[] {
  if (off <= GOOD) return [];
  const both = [
    { way: right > 0 ? ("right" as const) : ("left" as const), by: Math.abs(right) },
    { way: down > 0 ? ("down" as const) : ("up" as const), by: Math.abs(down) },
  ].sort((a, b) => b.by - a.by);
  return both.filter(({ by }, i) => i === 0 || by > GOOD / 2);
}
