/** The content over time: value with its band, refills, gaps hatched, thresholds, and where it is going. */
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { number } from "../format/numbers.ts";
import { useWords } from "../i18n/index.ts";
import { useDark } from "../theme.ts";
import { columns, gaps, type Outlook, type Point, type Span } from "./trend-data.ts";

export interface Threshold {
  value: number;
  tone: "low" | "critical" | "high";
  label: string;
}

interface Props {
  points: Point[];
  /** Longest time between two readings that is no gap, s. */
  most: number;
  span: Span;
  now: number;
  unit: string;
  decimals: number;
  zone: string;
  /** The scale reaches to it where it is known. */
  capacity: number | null;
  refills: { time: number; text: string }[];
  thresholds: Threshold[];
  outlook: Outlook | null;
  summary: string;
}

export function Trend(props: Props) {
  const holder = useRef<HTMLDivElement>(null);
  const { locale } = useWords();
  const dark = useDark();
  const holes = useMemo(
    () => gaps(props.points, props.most, Math.min(props.now, props.span.to)),
    [props.points, props.most, props.now, props.span.to],
  );
  const data = useMemo(
    () => columns(props.points, holes, props.outlook, props.span.to),
    [props.points, holes, props.outlook, props.span.to],
  );
  const latest = useRef(props);
  latest.current = props;
  const [plot, setPlot] = useState<uPlot | null>(null);
  const key = `${locale} ${dark} ${props.zone} ${props.unit}`;
  useEffect(() => {
    const element = holder.current;
    if (!element) return;
    void key;
    const made = new uPlot(options(element, locale, latest), [[]], element);
    const resized = new ResizeObserver(() => made.setSize(size(element)));
    resized.observe(element);
    setPlot(made);
    return () => {
      resized.disconnect();
      made.destroy();
      setPlot(null);
    };
  }, [key, locale]);
  useEffect(() => {
    if (!plot) return;
    holesOf.set(plot, holes);
    plot.batch(() => {
      plot.setData(data as uPlot.AlignedData, false);
      plot.setScale("x", { min: props.span.from, max: props.span.to });
    });
  }, [plot, data, holes, props.span.from, props.span.to]);
  return <div ref={holder} class="trend" role="img" aria-label={props.summary} />;
}

const holesOf = new WeakMap<uPlot, Span[]>();

const size = (element: HTMLElement) => ({ width: element.clientWidth, height: element.clientHeight });

function options(element: HTMLElement, locale: string, latest: { current: Props }): uPlot.Options {
  const style = getComputedStyle(element);
  const tint = (name: string) => style.getPropertyValue(name).trim();
  const props = () => latest.current;
  const axis = { stroke: tint("--muted"), grid: { stroke: tint("--line"), width: 1 }, ticks: { show: false } };
  const font = `12px ${style.fontFamily}`;
  return {
    ...size(element),
    padding: [14, 8, 0, 0],
    tzDate: (seconds) => uPlot.tzDate(new Date(seconds * 1000), props().zone),
    cursor: { y: false, points: { size: 7 }, drag: { x: false, y: false } },
    legend: { show: false },
    scales: { y: { range: (_, __, high) => [0, Math.max(props().capacity ?? 0, high || 1) * 1.02] } },
    axes: [
      {
        ...axis,
        font,
        values: (_, times, ___, ____, step) => times.map((time) => tick(locale, props().zone, time, step)),
      },
      {
        ...axis,
        font,
        size: 48,
        values: (_, values) => values.map((value) => number(locale, value, value % 1 ? 1 : 0)),
      },
    ],
    series: [
      {},
      { stroke: tint("--accent"), width: 2, points: { show: false } },
      { stroke: "transparent", points: { show: false } },
      { stroke: "transparent", points: { show: false } },
      { stroke: tint("--accent"), width: 1.5, dash: [5, 5], points: { show: false } },
      { stroke: "transparent", points: { show: false } },
      { stroke: "transparent", points: { show: false } },
    ],
    bands: [
      { series: [2, 3], fill: tint("--band") },
      { series: [5, 6], fill: tint("--band") },
    ],
    hooks: {
      drawAxes: [(plot) => hatch(plot, tint("--hatch"))],
      draw: [
        (plot) => drawThresholds(plot, props().thresholds, tint, font),
        (plot) => drawRefills(plot, props().refills, tint("--good")),
        (plot) => drawNow(plot, props().now, tint("--muted")),
      ],
      setCursor: [(plot) => readOut(plot, element, locale, props())],
    },
  };
}

function tick(locale: string, zone: string, time: number, step: number): string {
  const parts: Intl.DateTimeFormatOptions =
    step < 86400
      ? { hour: "2-digit", minute: "2-digit" }
      : step < 27 * 86400
        ? { day: "numeric", month: "short" }
        : { month: "short", year: "2-digit" };
  return new Intl.DateTimeFormat(locale, { ...parts, timeZone: zone }).format(time * 1000);
}

function hatch(plot: uPlot, stroke: string): void {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.beginPath();
  for (const hole of holesOf.get(plot) ?? []) {
    const left = Math.max(bbox.left, plot.valToPos(hole.from, "x", true));
    const right = Math.min(bbox.left + bbox.width, plot.valToPos(hole.to, "x", true));
    if (right > left) ctx.rect(left, bbox.top, right - left, bbox.height);
  }
  ctx.clip();
  ctx.strokeStyle = stroke;
  ctx.lineWidth = 1.5 * devicePixelRatio;
  ctx.beginPath();
  const step = 8 * devicePixelRatio;
  for (let x = bbox.left - bbox.height; x < bbox.left + bbox.width; x += step) {
    ctx.moveTo(x, bbox.top + bbox.height);
    ctx.lineTo(x + bbox.height, bbox.top);
  }
  ctx.stroke();
  ctx.restore();
}

function drawThresholds(plot: uPlot, thresholds: Threshold[], tint: (name: string) => string, font: string): void {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.setLineDash([2 * devicePixelRatio, 4 * devicePixelRatio]);
  ctx.lineWidth = devicePixelRatio;
  ctx.textAlign = "left";
  ctx.textBaseline = "alphabetic";
  ctx.font = font.replace("12px", `${11 * devicePixelRatio}px`);
  for (const { value, tone, label } of thresholds) {
    const y = plot.valToPos(value, "y", true);
    if (y < bbox.top || y > bbox.top + bbox.height) continue;
    ctx.strokeStyle = ctx.fillStyle = tint(tone === "critical" ? "--bad" : "--warn");
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
    ctx.fillText(label, bbox.left + 4 * devicePixelRatio, y - 4 * devicePixelRatio);
  }
  ctx.restore();
}

function drawRefills(plot: uPlot, refills: Props["refills"], fill: string): void {
  const { ctx, bbox } = plot;
  const half = 5 * devicePixelRatio;
  ctx.save();
  ctx.fillStyle = fill;
  for (const { time } of refills) {
    const x = plot.valToPos(time, "x", true);
    if (x < bbox.left || x > bbox.left + bbox.width) continue;
    const y = bbox.top + bbox.height;
    ctx.beginPath();
    ctx.moveTo(x, y - 2 * half);
    ctx.lineTo(x + half, y);
    ctx.lineTo(x - half, y);
    ctx.fill();
  }
  ctx.restore();
}

function drawNow(plot: uPlot, now: number, stroke: string): void {
  const { ctx, bbox } = plot;
  const x = plot.valToPos(now, "x", true);
  if (x < bbox.left || x > bbox.left + bbox.width - 1) return;
  ctx.save();
  ctx.strokeStyle = stroke;
  ctx.lineWidth = devicePixelRatio;
  ctx.beginPath();
  ctx.moveTo(x, bbox.top);
  ctx.lineTo(x, bbox.top + bbox.height);
  ctx.stroke();
  ctx.restore();
}

/** The value under the pointer, in words, above the plot. */
function readOut(plot: uPlot, element: HTMLElement, locale: string, props: Props): void {
  const index = plot.cursor.idx;
  const output = element.parentElement?.querySelector<HTMLElement>(".readout");
  if (!output) return;
  const time = index === null || index === undefined ? undefined : plot.data[0][index];
  const value = index === null || index === undefined ? undefined : (plot.data[1]?.[index] ?? plot.data[4]?.[index]);
  if (time === undefined || value === undefined || value === null) {
    output.textContent = "";
    return;
  }
  const when = new Intl.DateTimeFormat(locale, { dateStyle: "medium", timeStyle: "short", timeZone: props.zone });
  output.textContent = `${when.format(time * 1000)} · ${number(locale, value, props.decimals)} ${props.unit}`;
}
