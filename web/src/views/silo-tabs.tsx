/** Below a silo: events, tickets, calibration, rules; one at a time, by keyboard as the ARIA practices say. */
import { useRef, useState } from "preact/hooks";
import type { Event, PageOf, Place, Rule, Silo } from "../data/answers.ts";
import { useResource } from "../data/resources.ts";
import { duration, moment } from "../format/dates.ts";
import { mass, number, percent, volume } from "../format/numbers.ts";
import { useWords } from "../i18n/index.ts";
import { Amount } from "../parts/amount.tsx";
import { link, TABS, type Tab } from "../router.ts";
import { inForce } from "./places.ts";
import { Calibrations } from "./silo-calibration.tsx";
import { Tickets } from "./silo-tickets.tsx";

export function Tabs({ silo, tab }: { silo: Silo; tab: Tab }) {
  const { t } = useWords();
  const list = useRef<HTMLDivElement>(null);
  const open = (next: Tab) => {
    window.location.replace(link.silo(silo.id, next));
    list.current?.querySelector<HTMLElement>(`#tab-${next}`)?.focus();
  };
  const step = (event: KeyboardEvent) => {
    const way = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    // The focus moves at once, the address a moment later.
    const at = TABS.findIndex((one) => `tab-${one}` === (event.target as HTMLElement).id);
    const next = way && TABS[(at + way + TABS.length) % TABS.length];
    if (next) open(next);
  };
  return (
    <>
      <div ref={list} role="tablist" aria-label={t("silo.more")} onKeyDown={step}>
        {TABS.map((one) => (
          <button
            key={one}
            id={`tab-${one}`}
            type="button"
            role="tab"
            aria-selected={one === tab}
            aria-controls="tab-panel"
            tabIndex={one === tab ? 0 : -1}
            onClick={() => open(one)}
          >
            {t(`tab.${one}`)}
          </button>
        ))}
      </div>
      <div id="tab-panel" role="tabpanel" aria-labelledby={`tab-${tab}`} class="stack">
        <Panel silo={silo} tab={tab} />
      </div>
    </>
  );
}

function Panel({ silo, tab }: { silo: Silo; tab: Tab }) {
  if (tab === "tickets") return <Tickets silo={silo} />;
  if (tab === "calibration") return <Calibrations silo={silo} />;
  return tab === "rules" ? <Rules silo={silo} /> : <Events silo={silo} />;
}

function Events({ silo }: { silo: Silo }) {
  const { t, named, locale } = useWords();
  const path = `silos/${encodeURIComponent(silo.id)}/events?count=1000`;
  const events = useResource<PageOf<Event>>(path, "event", "forecast", `of:${silo.id}`);
  const [most, setMost] = useState(12);
  const all = [...(events.data?.items ?? [])].reverse();
  const rows = all.slice(0, most);
  if (rows.length === 0) return <p class="quiet">{t("events.none")}</p>;
  return (
    <>
      <div class="scroll">
        <table>
          <thead>
            <tr>
              <th scope="col">{t("events.when")}</th>
              <th scope="col">{t("events.what")}</th>
              <th scope="col" class="number">
                {t("events.amount")}
              </th>
            </tr>
          </thead>
          <tbody>
            {rows.map(({ id, kind, start, end, volume_m3, volume_std_m3, mass_kg }) => (
              <tr key={id}>
                <td>
                  {moment(locale, Date.parse(start), silo.zone)}
                  <span class="quiet small wide">
                    {" "}
                    · {duration(locale, (Date.parse(end) - Date.parse(start)) / 1000)}
                  </span>
                </td>
                <td>
                  <span class={`mark ${kind}`} aria-hidden="true" />
                  {named("event", kind)}
                </td>
                <td class="number">
                  <Amount
                    amount={
                      mass_kg === null
                        ? volume(locale, volume_m3, volume_std_m3)
                        : mass(locale, mass_kg, volume_m3 ? (mass_kg * volume_std_m3) / volume_m3 : null)
                    }
                  />
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      {all.length > most && (
        <button type="button" onClick={() => setMost(most + 50)}>
          {t("events.more")}
        </button>
      )}
    </>
  );
}

function Rules({ silo }: { silo: Silo }) {
  const { t, named, locale } = useWords();
  const rules = useResource<PageOf<Rule>>("rules", "rule");
  const places = useResource<PageOf<Place>>("places", "place");
  const rows = inForce(rules.data?.items ?? [], silo, places.data?.items ?? []);
  const level = ({ unit }: Rule, told: number | null) => {
    const value = told ?? silo.stale_after_s;
    if (unit.startsWith("fraction")) return percent(locale, value);
    return unit === "seconds" ? duration(locale, value) : duration(locale, value * 3600);
  };
  if (rows.length === 0) return <p class="quiet">{t("rules.none")}</p>;
  return (
    <>
      <p class="quiet small">{t("rules.about")}</p>
      <div class="scroll">
        <table>
          <thead>
            <tr>
              <th scope="col">{t("rules.kind")}</th>
              <th scope="col" class="number">
                {t("rules.level")}
              </th>
              <th scope="col" class="number">
                {t("rules.clear")}
              </th>
              <th scope="col" class="number">
                {t("rules.delay")}
              </th>
            </tr>
          </thead>
          <tbody>
            {rows.map((rule) => (
              <tr key={rule.id}>
                <th scope="row">
                  {named("alert", rule.kind)} {!rule.enabled && <span class="badge">{t("rules.off")}</span>}
                </th>
                <td class="number">{level(rule, rule.level)}</td>
                <td class="number">{level(rule, rule.clear)}</td>
                <td class="number">{rule.delay_s ? duration(locale, rule.delay_s) : number(locale, 0, 0)}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </>
  );
}
