/** All cameras: when each was last heard of, how often it comes, and the way to its installer's view. */
import { atLeast, useNow, useSurroundings } from "../context.ts";
import type { Camera, PageOf, Silo } from "../data/answers.ts";
import { change } from "../data/client.ts";
import { changed, useResource } from "../data/resources.ts";
import { age } from "../format/dates.ts";
import { useWords } from "../i18n/index.ts";
import { Edit, etag, NumberEntry, numberIn } from "../parts/edit.tsx";
import { Waiting } from "../parts/waiting.tsx";
import { link } from "../router.ts";

export function Cameras() {
  const { t } = useWords();
  const { site } = useSurroundings();
  const cameras = useResource<PageOf<Camera>>("cameras", "camera", "frame", "calibration");
  const silos = useResource<PageOf<Silo>>("silos", "silo", "reading", "forecast", "frame");
  if (!cameras.data) return <Waiting resource={cameras} />;
  const nameOf = (id: string) => silos.data?.items.find((silo) => silo.id === id)?.name ?? id;
  return (
    <div class="whole single">
      <main id="main" class="stack" tabIndex={-1}>
        <h1>{t("cameras.title")}</h1>
        <ul class="plain">
          {cameras.data.items.map((camera) => (
            <li key={camera.id} class="panel row apart">
              <CameraText camera={camera} silo={nameOf(camera.silo)} />
              <div class="row">
                {atLeast(site.role, "admin") && <Interval camera={camera} />}
                <a class="button" href={link.install(camera.id)}>
                  {t("cameras.install")}
                  <span class="unseen"> {camera.id}</span>
                </a>
              </div>
            </li>
          ))}
        </ul>
        {cameras.data.items.length === 0 && <p class="panel">{t("cameras.none")}</p>}
      </main>
    </div>
  );
}

/** How often it gives a frame: what the service keeps to where it drives the camera. */
function Interval({ camera }: { camera: Camera }) {
  const { t } = useWords();
  const send = async (entered: FormData) => {
    const minutes = numberIn(entered, "minutes");
    const expected_s = minutes === null ? null : Math.max(1, Math.round(minutes * 60));
    await change("PUT", `cameras/${encodeURIComponent(camera.id)}`, { expected_s }, etag(camera));
    changed((topics) => topics.includes("camera"));
  };
  const minutes = camera.expected_s === null ? null : camera.expected_s / 60;
  return (
    <Edit name={camera.id} title={t("cameras.interval")} version={camera.version} send={send}>
      <NumberEntry name="minutes" label={t("cameras.every")} unit="min" value={minutes} min={0.02} max={525_600} />
    </Edit>
  );
}

/** Why a camera that the service drives gives no frames: what its driver or command said, in English. */
export const Failing = ({ live }: { live: Camera["live"] }) =>
  live?.problem ? (
    <p class="note bad" lang="en">
      {live.problem}
    </p>
  ) : null;

function CameraText({ camera, silo }: { camera: Camera; silo: string }) {
  const { t, named, locale } = useWords();
  const now = useNow();
  const { last_captured, last_state, moved_since, proposed_calibration } = camera.state;
  const { live } = camera;
  return (
    <div>
      <h2>
        {camera.id} <span class="quiet">· </span>
        <a href={link.silo(camera.silo, "calibration")}>{silo}</a>
      </h2>
      <p class="small row">
        <span class="quiet">
          {last_captured === null ? t("cameras.never") : age(locale, (now - Date.parse(last_captured)) / 1000)}
        </span>
        {last_state && last_state !== "measured" && <span class="badge">{named("frame", last_state)}</span>}
        {moved_since && <span class="badge bad">{named("alert", "camera-moved")}</span>}
        {proposed_calibration && <span class="badge warn">{t("calibration.waiting")}</span>}
        {live && <span class={`badge${live.state === "failing" ? " bad" : ""}`}>{named("live", live.state)}</span>}
      </p>
      <Failing live={live} />
    </div>
  );
}
