/** Products, places, people and tokens, for the administrator. */
import { useState } from "preact/hooks";
import { useSurroundings } from "../context.ts";
import type { Camera, Grant, PageOf, Place, Token, User } from "../data/answers.ts";
import { address, change } from "../data/client.ts";
import { changed, useResource } from "../data/resources.ts";
import { fullMoment } from "../format/dates.ts";
import { bytes } from "../format/numbers.ts";
import { useWords } from "../i18n/index.ts";
import { Action } from "../parts/action.tsx";
import { ChoiceEntry, Edit } from "../parts/edit.tsx";
import { Facts } from "../parts/facts.tsx";
import { PlaceNames, Products } from "./settings-site.tsx";

const ROLES = ["percent", "viewer", "operator", "admin"] as const;
const TOKENS = ["camera", "read", "metrics", "admin"] as const;

const again = (topic: string) => changed((topics) => topics.includes(topic));

export function Settings() {
  const { t } = useWords();
  return (
    <div class="whole single">
      <main id="main" class="stack" tabIndex={-1}>
        <h1>{t("settings.title")}</h1>
        <Products />
        <PlaceNames />
        <People />
        <Tokens />
        <Machine />
      </main>
    </div>
  );
}

/** A secret that the server says once. */
function Once({ text, about }: { text: string; about: string }) {
  return (
    <div class="note stack" role="status">
      <p>{about}</p>
      <p class="secret">{text}</p>
    </div>
  );
}

function People() {
  const { t } = useWords();
  const users = useResource<PageOf<User>>("users", "user");
  const places = useResource<PageOf<Place>>("places", "place");
  const [invited, setInvited] = useState<string | null>(null);
  return (
    <section class="panel stack" aria-labelledby="people">
      <h2 id="people">{t("settings.people")}</h2>
      <ul class="plain">
        {(users.data?.items ?? []).map((user) => (
          <Person key={user.id} user={user} places={places.data?.items ?? []} />
        ))}
      </ul>
      <Action
        button={t("settings.invite")}
        send={async (entered) => {
          const place = String(entered.get("place")) || null;
          const body = { name: entered.get("name"), role: entered.get("role"), place };
          const made = await change<{ link: string }>("POST", "users", body);
          setInvited(made && address(made.link));
          again("user");
        }}
      >
        <label class="field">
          {t("login.name")}
          <input name="name" required maxLength={80} autocomplete="off" />
        </label>
        <Roles />
        <Places places={places.data?.items ?? []} />
      </Action>
      {invited && <Once text={invited} about={t("settings.link")} />}
    </section>
  );
}

const Roles = () => {
  const { t } = useWords();
  return (
    <label class="field">
      {t("settings.role")}
      <select name="role">
        {ROLES.map((role) => (
          <option key={role} value={role}>
            {t(`role.${role}`)}
          </option>
        ))}
      </select>
    </label>
  );
};

const Places = ({ places, chosen = "" }: { places: Place[]; chosen?: string }) => {
  const { t } = useWords();
  const of = places.map((place) => ({ value: place.id, text: place.name }));
  const everywhere = { value: "", text: t("settings.everywhere") };
  return <ChoiceEntry name="place" label={t("settings.place")} value={chosen} of={[everywhere, ...of]} />;
};

function Person({ user, places }: { user: User; places: Place[] }) {
  const { t, named } = useWords();
  const where = ({ place }: Grant) => places.find((one) => one.id === place)?.name ?? place ?? t("settings.everywhere");
  return (
    <li class="row apart">
      <div>
        <strong>{user.name}</strong>{" "}
        {user.grants.map((grant) => (
          <span key={grant.id} class="badge">
            {named("role", grant.role)} · {where(grant)}
          </span>
        ))}
        {user.disabled && <span class="badge bad">{t("settings.locked")}</span>}
      </div>
      {!user.disabled && (
        <div class="row">
          <RoleForm user={user} places={places} />
          <Action
            button={t("settings.lock", { name: user.name })}
            send={async () => {
              await change("DELETE", `users/${encodeURIComponent(user.name)}`);
              again("user");
            }}
          />
        </div>
      )}
    </li>
  );
}

const NONE = "none";

/** Gives a role on a place, in place of one that was there; or takes it. */
function RoleForm({ user, places }: { user: User; places: Place[] }) {
  const { t } = useWords();
  const first = user.grants[0];
  const send = async (entered: FormData) => {
    const place = String(entered.get("place")) || null;
    const role = String(entered.get("role"));
    const before = user.grants.find((grant) => grant.place === place);
    if (role !== NONE) await change("POST", "grants", { user: user.name, place, role });
    else if (before) await change("DELETE", `grants/${before.id}`);
    again("user");
  };
  const roles = ROLES.map((role) => ({ value: role as string, text: t(`role.${role}`) }));
  return (
    <Edit name={user.name} version={user.grants.length} send={send}>
      <ChoiceEntry
        name="role"
        label={t("settings.role")}
        value={first?.role ?? ""}
        of={[...roles, { value: NONE, text: t("settings.nothing") }]}
      />
      <Places places={places} chosen={first?.place ?? ""} />
    </Edit>
  );
}

function Tokens() {
  const { t, named, locale } = useWords();
  const { site } = useSurroundings();
  const tokens = useResource<PageOf<Token>>("tokens", "token");
  const cameras = useResource<PageOf<Camera>>("cameras", "camera");
  const [secret, setSecret] = useState<string | null>(null);
  const [role, setRole] = useState<string>("camera");
  return (
    <section class="panel stack" aria-labelledby="tokens">
      <h2 id="tokens">{t("settings.tokens")}</h2>
      <p class="quiet small">{t("settings.tokensAbout")}</p>
      <ul class="plain">
        {(tokens.data?.items ?? [])
          .filter((token) => token.revoked === null)
          .map((token) => (
            <li key={token.id} class="row apart">
              <div>
                <strong>{token.name ?? token.camera ?? token.id.slice(0, 8)}</strong>{" "}
                <span class="badge">{named("token", token.role)}</span>{" "}
                <span class="quiet small">{fullMoment(locale, Date.parse(token.created), site.zone)}</span>
              </div>
              <Action
                button={t("settings.revoke")}
                send={async () => {
                  await change("DELETE", `tokens/${encodeURIComponent(token.id)}`);
                  again("token");
                }}
              />
            </li>
          ))}
      </ul>
      <Action
        button={t("settings.make")}
        send={async (entered) => {
          const camera = role === "camera" ? { camera: entered.get("camera") } : {};
          const body = { role, name: String(entered.get("name")) || null, ...camera };
          const made = await change<{ secret: string }>("POST", "tokens", body);
          setSecret(made?.secret ?? null);
          again("token");
        }}
      >
        <label class="field">
          {t("settings.for")}
          <select name="role" value={role} onChange={(event) => setRole(event.currentTarget.value)}>
            {TOKENS.map((one) => (
              <option key={one} value={one}>
                {t(`token.${one}`)}
              </option>
            ))}
          </select>
        </label>
        {role === "camera" && (
          <label class="field">
            {t("settings.camera")}
            <select name="camera" required>
              {(cameras.data?.items ?? []).map((camera) => (
                <option key={camera.id} value={camera.id}>
                  {camera.id}
                </option>
              ))}
            </select>
          </label>
        )}
        <label class="field">
          {t("settings.label")}
          <input name="name" maxLength={80} autocomplete="off" />
        </label>
      </Action>
      {secret && <Once text={secret} about={t("settings.once")} />}
    </section>
  );
}

function Machine() {
  const { t, locale } = useWords();
  const { site } = useSurroundings();
  const rows = [
    [t("machine.version"), site.version],
    [t("machine.disk"), `${bytes(locale, site.disk_free_bytes)} / ${bytes(locale, site.disk_total_bytes)}`],
    [t("machine.queue"), String(site.frames_queued)],
    [t("machine.failed"), String(site.frames_failed)],
  ];
  return (
    <section class="panel stack" aria-labelledby="machine">
      <h2 id="machine">{t("machine.title")}</h2>
      <Facts rows={rows} />
    </section>
  );
}
