/** Signing in, and setting a password by a one-time link. */
import { useState } from "preact/hooks";
import type { Session } from "../data/answers.ts";
import { change, Problem } from "../data/client.ts";
import { useResource } from "../data/resources.ts";
import { useWords, type Words } from "../i18n/index.ts";
import { Preferences } from "../parts/preferences.tsx";
import { told } from "../parts/problems.ts";

interface Entered {
  name: string;
  password: string;
}

interface FormProps {
  title: string;
  button: string;
  /** Whether a name is asked for. */
  named: boolean;
  fresh: boolean;
  send: (entered: Entered) => Promise<void>;
}

function Form({ title, button, named, fresh, send }: FormProps) {
  const words = useWords();
  const { t } = words;
  const [failed, setFailed] = useState<string | null>(null);
  const [busy, setBusy] = useState(false);
  const submit = async (event: SubmitEvent) => {
    event.preventDefault();
    const entered = new FormData(event.currentTarget as HTMLFormElement);
    setBusy(true);
    setFailed(null);
    try {
      await send({ name: String(entered.get("name") ?? ""), password: String(entered.get("password")) });
    } catch (error) {
      setFailed(wording(error, words));
    }
    setBusy(false);
  };
  return (
    <main id="main" class="login" tabIndex={-1}>
      <span class="brand">
        <img src="./icon.svg" alt="" /> siloscope
      </span>
      <form class="panel stack" onSubmit={(event) => void submit(event)}>
        <h1>{title}</h1>
        {named && (
          <label class="field">
            {t("login.name")}
            <input name="name" autocomplete="username" required autofocus />
          </label>
        )}
        <label class="field">
          {t("login.password")}
          <input
            name="password"
            type="password"
            required
            minLength={fresh ? 10 : 1}
            autocomplete={fresh ? "new-password" : "current-password"}
          />
        </label>
        {fresh && <p class="quiet small">{t("login.rule")}</p>}
        {failed && (
          <p class="note bad" role="alert">
            {failed}
          </p>
        )}
        <button type="submit" class="first" disabled={busy}>
          {button}
        </button>
      </form>
      <Preferences />
    </main>
  );
}

function wording(error: unknown, words: Words): string {
  return error instanceof Problem && error.status === 401 ? words.t("login.wrong") : told(error, words);
}

export function Login({ entered }: { entered: () => void }) {
  const { t } = useWords();
  const send = async (body: Entered) => {
    await change("POST", "session", body);
    entered();
  };
  return <Form title={t("login.title")} button={t("login.enter")} named fresh={false} send={send} />;
}

/** Sets a password by a one-time link. A name is asked for where there is nobody yet: the first one chooses it. */
export function Welcome({ secret }: { secret: string }) {
  const { t } = useWords();
  const session = useResource<Session>("session", "session");
  const [asked, setAsked] = useState(false);
  const send = async (body: Entered) => {
    try {
      await change("POST", "session:welcome", { link: secret, password: body.password, name: body.name || null });
    } catch (error) {
      if (error instanceof Problem && error.status === 422) setAsked(true);
      throw error;
    }
    window.location.replace("./");
  };
  const named = asked || session.data?.kind === "local";
  return <Form title={t("login.welcome")} button={t("login.set")} named={named} fresh send={send} />;
}
