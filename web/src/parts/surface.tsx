/** The content's surface: in three dimensions where the browser can, else as a map from above. */
import { useEffect, useRef, useState } from "preact/hooks";
import { number } from "../format/numbers.ts";
import { useWords } from "../i18n/index.ts";
import { useDark } from "../theme.ts";
import type { SurfaceGrid } from "../three/grid.ts";
import { type Shape, surfaceColours } from "../three/meshes.ts";
import { type Colouring, colour, css, type Rgb } from "../three/palette.ts";
import type { Tints, View } from "../three/view.ts";

interface Props {
  grid: SurfaceGrid;
  shape: Shape;
  /** One sentence that says what is seen, for those who don't see it. */
  summary: string;
}

const COLOURINGS: Colouring[] = ["height", "deviation", "seen"];

export function Surface({ grid, shape, summary }: Props) {
  const { t } = useWords();
  const [by, setBy] = useState<Colouring>("height");
  const [flat, setFlat] = useState(!hasWebGl());
  return (
    <div class="surface">
      <div class="seg" role="radiogroup" aria-label={t("surface.colour")}>
        {COLOURINGS.map((one) => (
          <label key={one} class={one === by ? "on" : ""}>
            <input type="radio" name="colouring" checked={one === by} onChange={() => setBy(one)} />
            {t(`surface.${one}`)}
          </label>
        ))}
      </div>
      {flat ? (
        <FlatMap grid={grid} by={by} summary={summary} />
      ) : (
        <Solid grid={grid} shape={shape} by={by} summary={summary} failed={() => setFlat(true)} />
      )}
      <Legend grid={grid} by={by} />
      {flat && <p class="quiet small">{t("surface.noWebGl")}</p>}
    </div>
  );
}

function hasWebGl(): boolean {
  try {
    return document.createElement("canvas").getContext("webgl2") !== null;
  } catch {
    return false;
  }
}

interface Drawn extends Omit<Props, "shape"> {
  by: Colouring;
}

function Solid({ grid, shape, by, summary, failed }: Drawn & { shape: Shape; failed: () => void }) {
  const { t } = useWords();
  const canvas = useRef<HTMLCanvasElement>(null);
  const [view, setView] = useState<View | null>(null);
  const fail = useRef(failed);
  useEffect(() => {
    let made: View | null = null;
    let gone = false;
    void import("../three/view.ts")
      .then(({ createView }) => {
        if (gone || !canvas.current) return;
        made = createView(canvas.current);
        setView(made);
      })
      .catch(() => fail.current());
    return () => {
      gone = true;
      made?.dispose();
    };
  }, []);
  const dark = useDark();
  useEffect(() => {
    if (canvas.current) view?.show(grid, shape, by, tints(canvas.current));
    // `dark` changes the tints that the style sheet gives.
    void dark;
  }, [view, grid, shape, by, dark]);
  return (
    <canvas
      ref={canvas}
      class="solid"
      tabIndex={0}
      role="img"
      aria-label={`${summary} ${t("surface.keys")}`}
      {...(view ? handlers(view) : {})}
    />
  );
}

/** Turning by dragging and by arrow keys; a vertical finger still scrolls the page. */
function handlers(view: View) {
  const keys: Record<string, () => void> = {
    ArrowLeft: () => view.turn(-0.15, 0),
    ArrowRight: () => view.turn(0.15, 0),
    ArrowUp: () => view.turn(0, 0.1),
    ArrowDown: () => view.turn(0, -0.1),
    "+": () => view.zoom(0.9),
    "-": () => view.zoom(1.1),
  };
  return {
    onPointerMove: (event: PointerEvent) => {
      if (event.buttons) view.turn(-event.movementX * 0.008, event.movementY * 0.006);
    },
    onPointerDown: (event: PointerEvent) => (event.currentTarget as HTMLElement).setPointerCapture(event.pointerId),
    onKeyDown: (event: KeyboardEvent) => {
      const act = keys[event.key];
      if (!act) return;
      event.preventDefault();
      act();
    },
    onWheel: (event: WheelEvent) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      view.zoom(event.deltaY > 0 ? 1.08 : 0.92);
    },
  };
}

function tints(element: Element): Tints {
  const style = getComputedStyle(element);
  const read = (name: string): Rgb => {
    const value = Number.parseInt(style.getPropertyValue(name).trim().slice(1), 16);
    return [(value >> 16) / 255, ((value >> 8) & 255) / 255, (value & 255) / 255];
  };
  return { wall: read("--steel"), line: read("--steel-line"), body: read("--feed-body") };
}

function FlatMap({ grid, by, summary }: Drawn) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const context = canvas.current?.getContext("2d");
    if (!context) return;
    context.clearRect(0, 0, grid.side, grid.side);
    const colours = surfaceColours(grid, by);
    const cell = (2 * grid.reach) / grid.side;
    grid.heights.forEach((height, index) => {
      if (height === null) return;
      const [column, row] = [index % grid.side, Math.floor(index / grid.side)];
      const middle = (cells: number) => (cells + 0.5) * cell - grid.reach;
      context.fillStyle = css(colours.of(middle(column), middle(row)));
      context.fillRect(column, grid.side - 1 - row, 1, 1);
    });
  }, [grid, by]);
  return <canvas ref={canvas} class="flat" width={grid.side} height={grid.side} role="img" aria-label={summary} />;
}

function Legend({ grid, by }: { grid: SurfaceGrid; by: Colouring }) {
  const { t, locale } = useWords();
  if (by === "seen") {
    return (
      <p class="legend">
        <Swatch by={by} at={1} /> {t("surface.isSeen")} <Swatch by={by} at={0} /> {t("surface.notSeen")}
      </p>
    );
  }
  const { low, high } = surfaceColours(grid, by);
  const [factor, unit, decimals] = by === "height" ? [1, "m", 2] : [1000, "mm", 0];
  const text = (value: number) => `${number(locale, value * factor, decimals)} ${unit}`;
  return (
    <p class="legend">
      {text(low)}
      <svg class="scale" viewBox="0 0 40 1" preserveAspectRatio="none" aria-hidden="true">
        {Array.from({ length: 40 }, (_, i) => (
          <rect key={i} x={i} width={1.05} height={1} fill={css(colour(by, i / 39))} />
        ))}
      </svg>
      {text(high)}
    </p>
  );
}

const Swatch = ({ by, at }: { by: Colouring; at: number }) => (
  <svg class="swatch" viewBox="0 0 1 1" aria-hidden="true">
    <rect width={1} height={1} fill={css(colour(by, at))} />
  </svg>
);
