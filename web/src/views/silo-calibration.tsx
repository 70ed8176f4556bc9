/** A silo's calibrations: which one is in force, which waits for a person's word, and what came before. */
import { atLeast } from "../context.ts";
import type { Calibration, CameraState, PageOf, Run, Silo } from "../data/answers.ts";
import { api, change } from "../data/client.ts";
import { changed, useResource } from "../data/resources.ts";
import { fullMoment } from "../format/dates.ts";
import { useWords } from "../i18n/index.ts";
import { Action } from "../parts/action.tsx";
import { link } from "../router.ts";

export function Calibrations({ silo }: { silo: Silo }) {
  const { t } = useWords();
  const path = `silos/${encodeURIComponent(silo.id)}/calibrations`;
  const found = useResource<PageOf<Calibration>>(path, "calibration", `of:${silo.id}`);
  const rows = found.data?.items ?? [];
  return (
    <>
      {silo.now.cameras.map((camera) => (
        <CameraLine key={camera.id} camera={camera} silo={silo} />
      ))}
      {rows
        .filter((one) => one.state === "proposed")
        .map((one) => (
          <Proposal key={one.id} calibration={one} silo={silo} />
        ))}
      <ul class="plain">
        {rows
          .filter((one) => one.state !== "proposed")
          .map((one) => (
            <Line key={one.id} calibration={one} silo={silo} />
          ))}
      </ul>
      {found.data && rows.length === 0 && <p class="note">{t("calibration.none")}</p>}
      <Runs silo={silo} />
    </>
  );
}

function CameraLine({ camera, silo }: { camera: CameraState; silo: Silo }) {
  const { t, locale } = useWords();
  return (
    <div class="row apart">
      <p>
        {t("calibration.camera", { camera: camera.id })}
        {camera.moved_since && (
          <span class="badge bad">
            {t("calibration.moved", { time: fullMoment(locale, Date.parse(camera.moved_since), silo.zone) })}
          </span>
        )}
      </p>
      <a class="button" href={link.install(camera.id)}>
        {t("calibration.install")}
      </a>
    </div>
  );
}

function Proposal({ calibration, silo }: { calibration: Calibration; silo: Silo }) {
  const { t, locale } = useWords();
  const decide = (verb: string) => async () => {
    await change("POST", `calibrations/${encodeURIComponent(calibration.id)}:${verb}`);
    changed((topics) => topics.includes("calibration") || topics.includes("silo"));
  };
  return (
    <div class="note warn stack">
      <p>
        <strong>{t("calibration.proposed")}</strong>{" "}
        {t("calibration.from", {
          frames: calibration.frames,
          time: fullMoment(locale, Date.parse(calibration.valid_from), silo.zone),
        })}
      </p>
      {atLeast(silo.role, "operator") && (
        <div class="row">
          <Action button={t("calibration.confirm")} send={decide("confirm")} />
          <Action button={t("calibration.reject")} send={decide("reject")} />
        </div>
      )}
    </div>
  );
}

function Line({ calibration, silo }: { calibration: Calibration; silo: Silo }) {
  const { t, named, locale } = useWords();
  const time = (text: string) => fullMoment(locale, Date.parse(text), silo.zone);
  const { state, origin, frames, valid_from, valid_to, confirmed_by } = calibration;
  const inForce = state === "confirmed" && valid_to === null;
  return (
    <li>
      <strong>{named("calibration", inForce ? "inForce" : state)}</strong> · {named("origin", origin)} ·{" "}
      {t("calibration.frames", { n: frames })}
      <br />
      <span class="quiet small">
        {t("calibration.since", { time: time(valid_from) })}
        {valid_to && ` ${t("calibration.until", { time: time(valid_to) })}`}
        {confirmed_by && ` · ${t("calibration.by", { name: confirmed_by })}`}
      </span>
    </li>
  );
}

/** What measured the readings: the runs whose readings count, and those that later ones replaced. */
function Runs({ silo }: { silo: Silo }) {
  const { t, named, locale } = useWords();
  const path = `silos/${encodeURIComponent(silo.id)}`;
  const found = useResource<PageOf<Run>>(
    atLeast(silo.role, "viewer") ? `${path}/runs` : null,
    "reading",
    `of:${silo.id}`,
  );
  const rows = found.data?.items ?? [];
  if (rows.length === 0) return null;
  return (
    <section class="runs" aria-label={t("runs.title")}>
      <h3>{t("runs.title")}</h3>
      <ul class="plain">
        {rows.map((run) => (
          <li key={run.id}>
            <strong>{run.current > 0 ? named("origin", run.origin) : t("runs.replaced")}</strong> · siloscope{" "}
            {run.version} · {fullMoment(locale, Date.parse(run.created), silo.zone)}
            <br />
            <span class="quiet small">
              {t("runs.count", { current: run.current, replaced: run.replaced })} ·{" "}
              <a href={api(`${path}/readings?run=${run.id}&format=csv`)}>CSV</a>
            </span>
          </li>
        ))}
      </ul>
    </section>
  );
}
