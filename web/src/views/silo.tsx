/** One silo: what is in it, its surface, its trend, and everything that belongs to it. */
import { useMemo, useRef, useState } from "preact/hooks";
import { atLeast, useFiring, useNow } from "../context.ts";
import type { Alert, Surface as Answer, PageOf, Product, Silo } from "../data/answers.ts";
import { api } from "../data/client.ts";
import { useResource } from "../data/resources.ts";
import { clock, day, days, fullMoment } from "../format/dates.ts";
import { mass, number, percent, volume } from "../format/numbers.ts";
import { useWords, type Words } from "../i18n/index.ts";
import { AlertStrip } from "../parts/alert.tsx";
import { Amount } from "../parts/amount.tsx";
import { Age } from "../parts/card.tsx";
import { Section } from "../parts/section.tsx";
import { isLate, raised, shapeOf, toneOf } from "../parts/silo-state.ts";
import { Surface } from "../parts/surface.tsx";
import { Waiting } from "../parts/waiting.tsx";
import type { Tab } from "../router.ts";
import { link } from "../router.ts";
import type { SurfaceGrid } from "../three/grid.ts";
import { Tabs } from "./silo-tabs.tsx";
import { TrendPanel } from "./silo-trend.tsx";

export function SiloView({ id, tab }: { id: string; tab: Tab }) {
  const { t } = useWords();
  const path = `silos/${encodeURIComponent(id)}`;
  const silo = useResource<Silo>(path, "silo", "camera", "reading", "alert", "forecast", "frame", `of:${id}`);
  const alerts = useFiring().filter((alert) => alert.silo === id);
  if (!silo.data) return <Waiting resource={silo} />;
  const { role, zone } = silo.data;
  const all = atLeast(role, "viewer");
  return (
    <div class="whole single">
      <main id="main" class="silo" tabIndex={-1}>
        <div class="across stack">
          <Head silo={silo.data} />
          {alerts.map((alert) => (
            <AlertStrip key={alert.id} alert={alert} zone={zone} role={role} />
          ))}
        </div>
        {all ? <SurfacePanel silo={silo.data} alerts={alerts} /> : <SectionPanel silo={silo.data} alerts={alerts} />}
        <TrendPanel silo={silo.data} />
        {all && <Details silo={silo.data} />}
        {all && (
          <section class="panel across" aria-label={t("silo.more")}>
            <Tabs silo={silo.data} tab={tab} />
          </section>
        )}
      </main>
    </div>
  );
}

function Head({ silo }: { silo: Silo }) {
  const words = useWords();
  const { t } = words;
  const products = useResource<PageOf<Product>>("products", "product");
  const product = products.data?.items.find((one) => one.id === silo.product)?.name ?? silo.product;
  return (
    <>
      <div>
        <a class="quiet small" href={link.silos(silo.place)}>
          ← {t("silo.back")}
        </a>
        <div class="row apart">
          <h1>{silo.name}</h1>
          <Age silo={silo} />
        </div>
        {product && <p class="quiet">{product}</p>}
      </div>
      {silo.banner && <p class="note">{silo.banner}</p>}
      <dl class="panel facts">{facts(silo, words).map(fact)}</dl>
    </>
  );
}

interface Fact {
  name: string;
  value: preact.ComponentChildren;
  more?: string | null;
}

const fact = ({ name, value, more }: Fact) => (
  <div key={name}>
    <dt>{name}</dt>
    <dd>
      {value}
      {more && <small>{more}</small>}
    </dd>
  </div>
);

function facts(silo: Silo, { t, locale }: Words): Fact[] {
  const { now, forecast, zone } = silo;
  const found: (Fact | null)[] = [
    { name: t("silo.fill"), value: now.fill_fraction === null ? "–" : percent(locale, now.fill_fraction) },
    now.mass_kg === null
      ? null
      : { name: t("silo.mass"), value: <Amount amount={mass(locale, now.mass_kg, now.mass_std_kg)} /> },
    now.volume_m3 === null
      ? null
      : {
          name: t("silo.volume"),
          value: <Amount amount={volume(locale, now.volume_m3, now.volume_std_m3)} />,
          more: now.free_m3 === null ? null : t("silo.free", { amount: `${number(locale, now.free_m3, 1)} m³` }),
        },
    forecast.empty_by
      ? {
          name: t("silo.emptyBy"),
          value: day(locale, Date.parse(forecast.empty_by), zone),
          more:
            forecast.earliest && forecast.latest
              ? days(locale, Date.parse(forecast.earliest), Date.parse(forecast.latest), zone)
              : null,
        }
      : null,
    forecast.daily_m3 ? dailyUse(silo, forecast.daily_m3, { t, locale }) : null,
  ];
  return found.filter((one) => one !== null);
}

function dailyUse({ forecast }: Silo, daily: number, { t, locale }: Pick<Words, "t" | "locale">): Fact {
  const { daily_kg, daily_std_m3 } = forecast;
  const amount =
    daily_kg === null
      ? volume(locale, daily, daily_std_m3)
      : mass(locale, daily_kg, daily_std_m3 === null ? null : (daily_std_m3 / daily) * daily_kg);
  return { name: t("silo.daily"), value: <Amount amount={amount} /> };
}

const surfaceOf = (answer: Answer): SurfaceGrid => ({
  side: answer.side,
  reach: answer.half_width_m,
  heights: answer.heights_m.flat().map((height) => (height === null ? null : height + raised(answer.vessel))),
  std: answer.std_m.flat(),
  seen: answer.seen.flat(),
});

function SurfacePanel({ silo, alerts }: { silo: Silo; alerts: Alert[] }) {
  const words = useWords();
  const { t, locale } = words;
  const [at, setAt] = useState<string | null>(null);
  const path = `silos/${encodeURIComponent(silo.id)}/surface${at === null ? "" : `?at=${encodeURIComponent(at)}`}`;
  const answer = useResource<Answer>(path, "reading", `of:${silo.id}`);
  // The surface before stays until the one of another time has come.
  const kept = useRef<Answer | null>(null);
  kept.current = answer.data ?? kept.current;
  const shown = kept.current;
  const grid = useMemo(() => (shown ? surfaceOf(shown) : null), [shown]);
  if (!grid || !shown) return <SectionPanel silo={silo} alerts={alerts} />;
  const when = fullMoment(locale, Date.parse(shown.time), silo.zone);
  const summary = t("surface.summary", { silo: silo.name, time: when });
  return (
    <section class="panel stack" aria-label={t("silo.surface")}>
      <div class="row apart">
        <h2>{t("silo.surface")}</h2>
        <span class="quiet small">{when}</span>
      </div>
      <Surface grid={grid} shape={shapeOf(shown.vessel)} summary={summary} />
      <TimeSlider silo={silo} chosen={at} choose={setAt} />
    </section>
  );
}

const DAYS_BACK = 30;

/** Goes back through the last month's surfaces, six hours a step. */
function TimeSlider({
  silo,
  chosen,
  choose,
}: {
  silo: Silo;
  chosen: string | null;
  choose: (at: string | null) => void;
}) {
  const { t, locale } = useWords();
  const now = useNow();
  const steps = DAYS_BACK * 4;
  const back = chosen === null ? 0 : Math.round((now - Date.parse(chosen)) / 21_600_000);
  return (
    <label class="field">
      {t("surface.time")}
      <input
        type="range"
        min={-steps}
        max={0}
        value={0 - back}
        aria-valuetext={chosen === null ? t("surface.latest") : fullMoment(locale, Date.parse(chosen), silo.zone)}
        onChange={(event) => {
          const ago = -Number(event.currentTarget.value);
          choose(ago === 0 ? null : new Date(now - ago * 21_600_000).toISOString());
        }}
      />
    </label>
  );
}

/** Where no surface is to be seen: the section alone. */
function SectionPanel({ silo, alerts }: { silo: Silo; alerts: Alert[] }) {
  const { t } = useWords();
  return (
    <section class="panel" aria-label={t("silo.section")}>
      <div class="alone">
        <Section
          shape={shapeOf(silo.drawn)}
          fill={silo.now.fill_fraction}
          tone={toneOf(silo, alerts)}
          stale={isLate(silo, useNow())}
        />
      </div>
    </section>
  );
}

/** The camera's picture, and what the last reading says about itself. */
function Details({ silo }: { silo: Silo }) {
  const { t, locale } = useWords();
  const { now } = silo;
  return (
    <section class="panel across stack" aria-label={t("silo.reading")}>
      <div class="row apart">
        <h2>{t("silo.reading")}</h2>
        {now.time && <span class="quiet small">{clock(locale, Date.parse(now.time), silo.zone)}</span>}
      </div>
      <div class="picture-and-quality">
        {now.frame && (
          <img
            class="picture"
            src={api(`frames/${encodeURIComponent(now.frame)}/picture`)}
            alt={t("silo.picture", { silo: silo.name })}
            loading="lazy"
          />
        )}
        <Quality silo={silo} />
      </div>
    </section>
  );
}

function Quality({ silo: { now } }: { silo: Silo }) {
  const { t, named, locale, language } = useWords();
  const level = now.level_m;
  const refused = now.last_attempt?.status === "refused" ? now.last_attempt : null;
  const metres = (value: number | null | undefined) =>
    value === null || value === undefined ? "–" : `${number(locale, value, 2)} m`;
  return (
    <div class="stack">
      <dl class="facts">
        {[
          { name: t("quality.level"), value: metres(level?.mean) },
          { name: t("quality.lowest"), value: metres(level?.min) },
          { name: t("quality.highest"), value: metres(level?.max) },
          { name: t("quality.seen"), value: now.coverage === null ? "–" : percent(locale, now.coverage) },
        ].map(fact)}
      </dl>
      {refused && (
        <p class="note warn">
          <strong>{named("reason", refused.reason ?? "refused")}</strong> {language === "en" && refused.message}
        </p>
      )}
      <ul class="plain">
        {now.quality.map(({ code, message, severity }) => (
          <li key={code} class={`note${severity === "note" ? "" : " warn"}`}>
            <strong>{named("reason", code)}</strong> {language === "en" && message}
          </li>
        ))}
      </ul>
      {now.quality.length === 0 && !refused && <p class="quiet">{t("quality.nothing")}</p>}
    </div>
  );
}
