/** All cameras: when each was last heard of, and the way to its installer's view. */
import { useNow } from "../context.ts";
import type { Camera, PageOf, Silo } from "../data/answers.ts";
import { useResource } from "../data/resources.ts";
import { age } from "../format/dates.ts";
import { useWords } from "../i18n/index.ts";
import { Waiting } from "../parts/waiting.tsx";
import { link } from "../router.ts";

export function Cameras() {
  const { t } = useWords();
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
              <a class="button" href={link.install(camera.id)}>
                {t("cameras.install")}
                <span class="unseen"> {camera.id}</span>
              </a>
            </li>
          ))}
        </ul>
        {cameras.data.items.length === 0 && <p class="panel">{t("cameras.none")}</p>}
      </main>
    </div>
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
