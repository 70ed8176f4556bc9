/** Below a silo: events, tickets, calibration, rules, settings; one at a time, by keyboard as the ARIA practices say. */
import { useRef, useState } from "preact/hooks";
import { atLeast } from "../context.ts";
import type { Event, PageOf, Silo } from "../data/answers.ts";
import { useResource } from "../data/resources.ts";
import { duration, moment } from "../format/dates.ts";
import { mass, volume } from "../format/numbers.ts";
import { useWords } from "../i18n/index.ts";
import { Amount } from "../parts/amount.tsx";
import { link, TABS, type Tab } from "../router.ts";
import { Calibrations } from "./silo-calibration.tsx";
import { Rules } from "./silo-rules.tsx";
import { SiloSettings } from "./silo-settings.tsx";
import { Tickets } from "./silo-tickets.tsx";

export function Tabs({ silo, tab }: { silo: Silo; tab: Tab }) {
  const { t } = useWords();
  const list = useRef<HTMLDivElement>(null);
  const tabs = TABS.filter((one) => one !== "settings" || atLeast(silo.role, "admin"));
  const shown = tabs.includes(tab) ? tab : "events";
  const open = (next: Tab) => {
    window.location.replace(link.silo(silo.id, next));
    list.current?.querySelector<HTMLElement>(`#tab-${next}`)?.focus();
  };
  const step = (event: KeyboardEvent) => {
    const way = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    // The focus moves at once, the address a moment later.
    const at = tabs.findIndex((one) => `tab-${one}` === (event.target as HTMLElement).id);
    const next = way && tabs[(at + way + tabs.length) % tabs.length];
    if (next) open(next);
  };
  return (
    <>
      <div ref={list} role="tablist" aria-label={t("silo.more")} onKeyDown={step}>
        {tabs.map((one) => (
          <button
            key={one}
            id={`tab-${one}`}
            type="button"
            role="tab"
            aria-selected={one === shown}
            aria-controls="tab-panel"
            tabIndex={one === shown ? 0 : -1}
            onClick={() => open(one)}
          >
            {t(`tab.${one}`)}
          </button>
        ))}
      </div>
      <div id="tab-panel" role="tabpanel" aria-labelledby={`tab-${shown}`} class="stack">
        <Panel silo={silo} tab={shown} />
      </div>
    </>
  );
}

function Panel({ silo, tab }: { silo: Silo; tab: Tab }) {
  if (tab === "tickets") return <Tickets silo={silo} />;
  if (tab === "calibration") return <Calibrations silo={silo} />;
  if (tab === "settings") return <SiloSettings silo={silo} />;
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
