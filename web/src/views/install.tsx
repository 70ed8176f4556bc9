/** The installer's view: how the camera hangs now and which way to turn it, to be read from a ladder. */
import { useNow } from "../context.ts";
import type { Pose as Answer, Camera, PageOf } from "../data/answers.ts";
import { api } from "../data/client.ts";
import { useResource } from "../data/resources.ts";
import { age } from "../format/dates.ts";
import { degrees, number } from "../format/numbers.ts";
import { useWords } from "../i18n/index.ts";
import { aimOf, GOOD, turns } from "../parts/aim.ts";
import { Waiting } from "../parts/waiting.tsx";
import { link } from "../router.ts";
import { Failing } from "./cameras.tsx";

export function Install({ camera }: { camera: string }) {
  const { t, named, locale, language } = useWords();
  const now = useNow();
  const path = `cameras/${encodeURIComponent(camera)}/pose`;
  const found = useResource<Answer>(path, "frame", "reading", "camera", "calibration");
  const cameras = useResource<PageOf<Camera>>("cameras", "camera", "frame", "calibration");
  if (!found.data) return <Waiting resource={found} />;
  const { data } = found;
  const live = cameras.data?.items.find((one) => one.id === camera)?.live ?? null;
  return (
    <main id="main" class="install" tabIndex={-1}>
      <div class="row apart">
        <a class="button" href={data.silo ? link.silo(data.silo, "calibration") : link.cameras}>
          ← {t("install.back")}
        </a>
        <strong>{camera}</strong>
        <span class="quiet">{data.time ? age(locale, (now - Date.parse(data.time)) / 1000) : ""}</span>
      </div>
      <h1 class="unseen">{t("install.title", { camera })}</h1>
      <div aria-live="polite" class="stack">
        {data.r_x !== null && data.r_y !== null ? (
          <Pose pose={data} r_x={data.r_x} r_y={data.r_y} />
        ) : (
          <p class="hint">{data.frame === null ? t("install.waiting") : named("reason", data.reason ?? "refused")}</p>
        )}
      </div>
      <Failing live={live} />
      {data.message && language === "en" && <p class="note warn">{data.message}</p>}
      {data.frame !== null && (
        <img class="picture" src={api(`frames/${encodeURIComponent(data.frame)}/picture`)} alt={t("install.picture")} />
      )}
    </main>
  );
}

function Pose({ pose, r_x, r_y }: { pose: Answer; r_x: number; r_y: number }) {
  const { t, locale } = useWords();
  const aim = aimOf(r_x, r_y);
  const ways = turns(aim);
  const std = Math.hypot(pose.std?.r_x ?? 0, pose.std?.r_y ?? 0);
  return (
    <>
      <p>
        <span class="big">{degrees(locale, aim.off)}</span>
        <br />
        <span class="quiet">
          {t("install.off")} {std > 0 && `(± ${degrees(locale, std, 2)})`}
        </span>
      </p>
      <p class="hint">
        {ways.length === 0
          ? t("install.good")
          : ways.map(({ way, by }) => (
              <span key={way} class="turn">
                {t(`install.${way}`, { angle: degrees(locale, by) })}
              </span>
            ))}
      </p>
      <Target right={aim.right} down={aim.down} std={std} good={ways.length === 0} />
      {pose.t_x !== null && pose.t_y !== null && (
        <p class="quiet">
          {t("install.aside", { distance: `${number(locale, 100 * Math.hypot(pose.t_x, pose.t_y), 0)} cm` })}
        </p>
      )}
    </>
  );
}

const REACH = (25 * Math.PI) / 180;

/** Where the axis goes, as seen in the camera's picture: the dot must come into the ring. */
function Target({ right, down, std, good }: { right: number; down: number; std: number; good: boolean }) {
  const scale = 100 / REACH;
  const length = Math.hypot(right, down) || 1;
  const short = Math.min(1, REACH / length);
  const [x, y] = [right * scale * short, down * scale * short];
  const tip = (along: number, aside: number) =>
    `${x - (x / Math.hypot(x, y)) * along - (y / Math.hypot(x, y)) * aside} ${y - (y / Math.hypot(x, y)) * along + (x / Math.hypot(x, y)) * aside}`;
  return (
    <svg class="target" viewBox="-110 -110 220 220" aria-hidden="true">
      <circle r="100" />
      <circle r="50" />
      <line x1="-105" x2="105" y1="0" y2="0" />
      <line y1="-105" y2="105" x1="0" x2="0" />
      <circle class="pass" r={GOOD * scale} />
      {!good && <path class="arrow" d={`M0 0L${tip(16, 0)}M${tip(26, 10)}L${tip(14, 0)}L${tip(26, -10)}`} />}
      <circle class="doubt" cx={x} cy={y} r={Math.max(2, 2 * std * scale)} />
      <circle class={`aim${good ? " good" : ""}`} cx={x} cy={y} r="9" />
    </svg>
  );
}
