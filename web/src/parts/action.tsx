/** A form that sends something, and says so where it could not. */
import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import { useWords } from "../i18n/index.ts";
import { told } from "./problems.ts";

interface Props {
  button: string;
  /** What the button is for, for who can't see where it stands. */
  about?: string;
  send: (entered: FormData) => Promise<void>;
  children?: ComponentChildren;
}

export function Action({ button, about, send, children }: Props) {
  const words = useWords();
  const [failed, setFailed] = useState<string | null>(null);
  const [busy, setBusy] = useState(false);
  const submit = async (event: SubmitEvent) => {
    event.preventDefault();
    setBusy(true);
    setFailed(null);
    try {
      await send(new FormData(event.currentTarget as HTMLFormElement));
    } catch (error) {
      setFailed(told(error, words));
    }
    setBusy(false);
  };
  return (
    <form class="form" onSubmit={(event) => void submit(event)}>
      {children}
      <button type="submit" disabled={busy}>
        {button}
        {about && <span class="unseen"> {about}</span>}
      </button>
      {failed && (
        <p class="note bad" role="alert">
          {failed}
        </p>
      )}
    </form>
  );
}
