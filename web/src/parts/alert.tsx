/** One alert: what it is, since when, and the button that says "seen". */
import { useState } from "preact/hooks";
import { atLeast } from "../context.ts";
import type { Alert } from "../data/answers.ts";
import { change } from "../data/client.ts";
import { changed } from "../data/resources.ts";
import { shortMoment } from "../format/dates.ts";
import { useWords } from "../i18n/index.ts";
import { told } from "./problems.ts";

interface Props {
  alert: Alert;
  zone: string;
  /** What who looks may do with its silo. */
  role: string | null;
  /** The silo's name, where it is not plain from the place. */
  named?: string;
}

const GRAVE = new Set(["critical", "overfill", "sudden-drop", "bridging"]);

export function AlertStrip({ alert, zone, role, named }: Props) {
  const words = useWords();
  const { t, named: word, locale } = words;
  const [failed, setFailed] = useState<string | null>(null);
  const [busy, setBusy] = useState(false);
  const acknowledge = async () => {
    setBusy(true);
    setFailed(null);
    try {
      await change("POST", `alerts/${encodeURIComponent(alert.id)}:acknowledge`, {});
      changed((topics) => topics.includes("alert"));
    } catch (error) {
      setFailed(told(error, words));
    }
    setBusy(false);
  };
  const state = alert.resolved ? "over" : alert.acknowledged ? "seen" : GRAVE.has(alert.kind) ? "bad" : "warn";
  return (
    <div class={`alert ${state}`}>
      <span>
        {named && <strong>{named}: </strong>}
        <strong>{word("alert", alert.kind)}</strong>{" "}
        <span>{t("alerts.since", { time: shortMoment(locale, Date.parse(alert.since), zone) })}</span>
        {alert.resolved && (
          <span> · {t("alerts.over", { time: shortMoment(locale, Date.parse(alert.resolved), zone) })}</span>
        )}
        {alert.acknowledged && <span> · {t("alerts.seenBy", { name: alert.acknowledged_by ?? "" })}</span>}
        {failed && <span role="alert"> · {failed}</span>}
      </span>
      {!alert.acknowledged && !alert.resolved && atLeast(role, "operator") && (
        <button type="button" disabled={busy} onClick={() => void acknowledge()}>
          {t("alerts.acknowledge")}
          <span class="unseen">
            {" "}
            {named ?? ""} {word("alert", alert.kind)}
          </span>
        </button>
      )}
    </div>
  );
}
