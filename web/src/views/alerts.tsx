/** All alerts: what is firing now, and what has been. */
import { useState } from "preact/hooks";
import { FIRING } from "../context.ts";
import type { Alert, PageOf, Silo } from "../data/answers.ts";
import { useResource } from "../data/resources.ts";
import { useWords } from "../i18n/index.ts";
import { AlertStrip } from "../parts/alert.tsx";
import { Waiting } from "../parts/waiting.tsx";

export function Alerts() {
  const { t } = useWords();
  const [past, setPast] = useState(false);
  const alerts = useResource<PageOf<Alert>>(past ? "alerts?state=resolved&count=200" : FIRING, "alert");
  const silos = useResource<PageOf<Silo>>("silos", "silo", "reading", "alert", "forecast", "frame");
  if (!alerts.data) return <Waiting resource={alerts} />;
  const siloOf = (id: string) => silos.data?.items.find((silo) => silo.id === id);
  return (
    <div class="whole single">
      <main id="main" class="stack" tabIndex={-1}>
        <div class="row apart">
          <h1>{t("alerts.title")}</h1>
          <div class="seg">
            {[false, true].map((one) => (
              <button
                key={String(one)}
                type="button"
                class={one === past ? "on" : ""}
                aria-pressed={one === past}
                onClick={() => setPast(one)}
              >
                {t(one ? "alerts.past" : "alerts.now")}
              </button>
            ))}
          </div>
        </div>
        {alerts.data.items.length === 0 && <p class="panel">{t(past ? "alerts.noPast" : "alerts.none")}</p>}
        <ul class="plain">
          {alerts.data.items.map((alert) => (
            <li key={alert.id}>
              <AlertStrip
                alert={alert}
                zone={siloOf(alert.silo)?.zone ?? "UTC"}
                role={siloOf(alert.silo)?.role ?? null}
                named={siloOf(alert.silo)?.name ?? alert.silo}
              />
            </li>
          ))}
        </ul>
      </main>
    </div>
  );
}
