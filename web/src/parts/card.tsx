/** A silo at a glance. */
import { useNow } from "../context.ts";
import type { Alert, Silo } from "../data/answers.ts";
import { age, day, days } from "../format/dates.ts";
import { mass, percent, volume } from "../format/numbers.ts";
import { useWords } from "../i18n/index.ts";
import { link } from "../router.ts";
import { AlertStrip } from "./alert.tsx";
import { Amount } from "./amount.tsx";
import { Section } from "./section.tsx";
import { isLate, shapeOf, toneOf } from "./silo-state.ts";

interface Props {
  silo: Silo;
  product: string | null;
  alerts: Alert[];
}

export function Card({ silo, product, alerts }: Props) {
  const { t, locale } = useWords();
  const late = isLate(silo, useNow());
  const { now } = silo;
  return (
    <li>
      <article class="card">
        <Section shape={shapeOf(silo.drawn)} fill={now.fill_fraction} tone={toneOf(silo, alerts)} stale={late} />
        <div>
          <h2>
            <a href={link.silo(silo.id)}>{silo.name}</a>
          </h2>
          {product && <p class="quiet small">{product}</p>}
          <p class="amounts">
            <span class="share">{now.fill_fraction === null ? "–" : percent(locale, now.fill_fraction)}</span>
            {now.mass_kg !== null && (
              <span class="mass">
                <Amount amount={mass(locale, now.mass_kg, now.mass_std_kg)} />
              </span>
            )}
          </p>
          {now.mass_kg === null && now.volume_m3 !== null && (
            <p class="mass">
              <Amount amount={volume(locale, now.volume_m3, now.volume_std_m3)} />
            </p>
          )}
          <EmptyBy silo={silo} />
          <Age silo={silo} />
        </div>
        {(silo.banner || alerts.length > 0) && (
          <div class="strip">
            {silo.banner && <p class="note small">{silo.banner}</p>}
            {alerts.map((alert) => (
              <AlertStrip key={alert.id} alert={alert} zone={silo.zone} role={silo.role} />
            ))}
          </div>
        )}
      </article>
      {now.fill_fraction === null && <span class="unseen">{t("card.unknown")}</span>}
    </li>
  );
}

export function EmptyBy({ silo: { forecast, zone } }: { silo: Silo }) {
  const { t, locale } = useWords();
  if (!forecast.empty_by) return null;
  const { empty_by, earliest, latest } = forecast;
  return (
    <p class="empty-by">
      {t("card.emptyBy", { day: day(locale, Date.parse(empty_by), zone) })}
      {earliest && latest && (
        <span class="quiet small"> {days(locale, Date.parse(earliest), Date.parse(latest), zone)}</span>
      )}
    </p>
  );
}

/** How old the reading is, with a mark where it is late, and why the last frame gave none. */
export function Age({ silo }: { silo: Silo }) {
  const { t, named, locale } = useWords();
  const clock = useNow();
  const { now } = silo;
  const attempt = now.last_attempt?.status === "refused" ? now.last_attempt : null;
  return (
    <p class="foot small">
      {isLate(silo, clock) && <span class="badge bad">{t("card.late")}</span>}
      {attempt && <span class="badge warn">{named("reason", attempt.reason ?? "refused")}</span>}
      <span class="quiet">
        {now.time === null ? named("state", now.state) : age(locale, (clock - Date.parse(now.time)) / 1000)}
      </span>
    </p>
  );
}
