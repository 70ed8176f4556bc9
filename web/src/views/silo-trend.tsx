/** The trend's panel: how far back, the plot, the use below it, and the same in a table. */
import { useMemo, useState } from "preact/hooks";
import { atLeast, useNow } from "../context.ts";
import type { Trend as Answer, Bucket, Event, PageOf, Place, Rule, Silo } from "../data/answers.ts";
import { api } from "../data/client.ts";
import { useResource } from "../data/resources.ts";
import { day, midnights } from "../format/dates.ts";
import { massUnit, number, percent } from "../format/numbers.ts";
import { useWords } from "../i18n/index.ts";
import { type Threshold, Trend } from "../parts/trend.tsx";
import { daily, gaps, type Outlook, type Point, type Span, uses } from "../parts/trend-data.ts";
import { UseBars } from "../parts/use-bars.tsx";
import { inForce } from "./places.ts";

const RANGES = { week: 7, month: 30, year: 365, all: 730 } as const;
type Range = keyof typeof RANGES;

const DAY = 86_400;
const BUCKETS = 400;

/** What the plot's axis counts: tonnes, kilograms, cubic metres, or percent where only that may be seen. */
interface Measure {
  unit: string;
  decimals: number;
  of: (bucket: Bucket) => number | null;
  stdOf: (bucket: Bucket) => number | null;
  /** One cubic metre in this unit; null where it is not known. */
  perCubicMetre: number | null;
}

function measureOf({ now }: Silo): Measure {
  const { capacity_m3 } = now;
  if (now.volume_m3 === null) {
    const of = (bucket: Bucket) => (bucket.fill_fraction === null ? null : bucket.fill_fraction * 100);
    return { unit: "%", decimals: 0, of, stdOf: () => null, perCubicMetre: capacity_m3 ? 100 / capacity_m3 : null };
  }
  if (now.mass_kg === null || !now.volume_m3) {
    return { unit: "m³", decimals: 1, of: (b) => b.volume_m3, stdOf: (b) => b.volume_std_m3, perCubicMetre: 1 };
  }
  const density = now.mass_kg / now.volume_m3;
  const { unit, factor } = massUnit((capacity_m3 ?? now.volume_m3) * density);
  const stdOf = ({ mass_kg, volume_m3, volume_std_m3 }: Bucket) =>
    mass_kg === null || !volume_m3 || volume_std_m3 === null ? null : (volume_std_m3 / volume_m3) * mass_kg * factor;
  const of = ({ mass_kg }: Bucket) => (mass_kg === null ? null : mass_kg * factor);
  return { unit, decimals: unit === "t" ? 1 : 0, of, stdOf, perCubicMetre: density * factor };
}

export function TrendPanel({ silo }: { silo: Silo }) {
  const { t } = useWords();
  const now = Math.floor(useNow() / 60_000) * 60;
  const [range, setRange] = useState<Range>("month");
  const from = now - RANGES[range] * DAY;
  const path = `silos/${encodeURIComponent(silo.id)}`;
  const query = `from=${iso(from)}&to=${iso(now + 60)}`;
  // A minute's step would be another address every minute: the start is rounded to the hour.
  const hour = Math.floor(from / 3600) * 3600;
  const readings = useResource<Answer>(
    `${path}/readings?from=${iso(hour)}&buckets=${BUCKETS}`,
    "reading",
    `of:${silo.id}`,
  );
  const events = useResource<PageOf<Event>>(`${path}/events?from=${iso(hour)}`, "event", "reading", `of:${silo.id}`);
  const rules = useResource<PageOf<Rule>>(atLeast(silo.role, "viewer") ? "rules" : null, "rule");
  const places = useResource<PageOf<Place>>("places", "place");
  const measure = useMemo(() => measureOf(silo), [silo]);
  const points = useMemo(() => pointsOf(readings.data?.items ?? [], measure), [readings.data, measure]);
  const most = Math.max(silo.stale_after_s, (2.5 * (now - from)) / BUCKETS);
  const outlook = outlookOf(silo, measure);
  const ahead = outlook && range !== "year" && range !== "all" ? Math.min(14, RANGES[range] / 3) * DAY : 0;
  const span = { from, to: now + ahead };
  return (
    <section class="panel stack" aria-label={t("trend.title")}>
      <div class="row apart">
        <h2>{t("trend.title")}</h2>
        <div class="seg">
          {(Object.keys(RANGES) as Range[]).map((one) => (
            <button
              key={one}
              type="button"
              class={one === range ? "on" : ""}
              aria-pressed={one === range}
              onClick={() => setRange(one)}
            >
              {t(`trend.${one}`)}
            </button>
          ))}
        </div>
      </div>
      <Plots
        silo={silo}
        measure={measure}
        points={points}
        most={most}
        span={span}
        now={now}
        events={events.data?.items ?? []}
        rules={inForce(rules.data?.items ?? [], silo, places.data?.items ?? [])}
        outlook={ahead ? outlook : null}
      />
      <Table points={points} measure={measure} zone={silo.zone} />
      {atLeast(silo.role, "viewer") && (
        <p class="small">
          {t("trend.export")} <a href={api(`${path}/readings?${query}&format=csv`)}>CSV</a>{" "}
          <a href={api(`${path}/readings?${query}&format=parquet`)}>Parquet</a>
        </p>
      )}
    </section>
  );
}

const iso = (seconds: number): string => new Date(seconds * 1000).toISOString().replace(".000", "");

function pointsOf(buckets: Bucket[], measure: Measure): Point[] {
  return buckets.flatMap((bucket) => {
    const value = measure.of(bucket);
    return value === null ? [] : [{ time: Date.parse(bucket.time) / 1000, value, std: measure.stdOf(bucket) }];
  });
}

function outlookOf({ forecast }: Silo, { perCubicMetre }: Measure): Outlook | null {
  if (!forecast.empty_by || !forecast.daily_m3 || perCubicMetre === null) return null;
  const factor = perCubicMetre / DAY;
  return { rate: forecast.daily_m3 * factor, rateStd: (forecast.daily_std_m3 ?? 0) * factor };
}

interface PlotsProps {
  silo: Silo;
  measure: Measure;
  points: Point[];
  most: number;
  span: Span;
  now: number;
  events: Event[];
  rules: Rule[];
  outlook: Outlook | null;
}

function Plots({ silo, measure, points, most, span, now, events, rules, outlook }: PlotsProps) {
  const { t, named, locale } = useWords();
  const holes = useMemo(() => gaps(points, most, Math.min(now, span.to)), [points, most, now, span.to]);
  const days = Math.max(1, Math.ceil((span.to - span.from) / 90 / DAY));
  const full =
    silo.now.capacity_m3 === null || measure.perCubicMetre === null
      ? null
      : silo.now.capacity_m3 * measure.perCubicMetre;
  const capacity = measure.unit === "%" ? 100 : full;
  const refills = events
    .filter((event) => event.kind === "refill")
    .map((event) => ({ time: Date.parse(event.start) / 1000, text: "" }));
  const last = points.at(-1);
  const summary = last
    ? t("trend.summary", {
        silo: silo.name,
        value: `${number(locale, last.value, measure.decimals)} ${measure.unit}`,
        refills: refills.length,
        gaps: holes.length,
      })
    : t("trend.empty");
  const borders = useMemo(() => midnights(span.from, span.to, silo.zone, days), [span.from, span.to, silo.zone, days]);
  const used = uses(points, holes, borders);
  return (
    <div>
      <p class="readout">{"\u00a0"}</p>
      <Trend
        points={points}
        most={most}
        span={span}
        now={now}
        unit={measure.unit}
        decimals={measure.decimals}
        zone={silo.zone}
        capacity={capacity}
        refills={refills}
        thresholds={thresholdsOf(rules, capacity, named)}
        outlook={outlook}
        summary={summary}
      />
      <UseBars
        uses={used}
        span={span}
        label={t(days > 1 ? "trend.useIn" : "trend.usePerDay", { days })}
        text={(amount) => `${number(locale, amount, measure.decimals)} ${measure.unit}`}
      />
      <p class="legend keys">
        <span class="key band">{t("trend.band")}</span>
        <span class="key refill">{t("trend.refill")}</span>
        <span class="key gap">{t("trend.gap")}</span>
        {outlook && <span class="key ahead">{t("trend.ahead")}</span>}
      </p>
    </div>
  );
}

/** The levels of the rules that hold for a silo. */
function thresholdsOf(
  rules: Rule[],
  capacity: number | null,
  named: (family: string, name: string) => string,
): Threshold[] {
  if (capacity === null) return [];
  const tones = { low: "low", critical: "critical", overfill: "high" } as const;
  return (Object.keys(tones) as (keyof typeof tones)[]).flatMap((kind) => {
    const best = rules.find((rule) => rule.kind === kind);
    if (!best?.enabled || best.level === null) return [];
    return [{ value: best.level * capacity, tone: tones[kind], label: named("alert", kind) }];
  });
}

function Table({ points, measure, zone }: { points: Point[]; measure: Measure; zone: string }) {
  const { t, locale } = useWords();
  const text = (value: number) =>
    measure.unit === "%" ? percent(locale, value / 100) : `${number(locale, value, measure.decimals)} ${measure.unit}`;
  const rows = useMemo(() => daily(points, (time) => day(locale, time, zone)).slice(0, 60), [points, locale, zone]);
  return (
    <details>
      <summary class="small">{t("trend.table")}</summary>
      <div class="scroll">
        <table>
          <thead>
            <tr>
              <th scope="col">{t("trend.day")}</th>
              <th scope="col" class="number">
                {t("trend.atEnd")}
              </th>
            </tr>
          </thead>
          <tbody>
            {rows.map(({ day: name, point }) => (
              <tr key={name}>
                <th scope="row">{name}</th>
                <td class="number">{text(point.value)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </details>
  );
}
