/** What somebody may change: closed until they want to, with its entries, and a word once it is saved. */
import type { ComponentChildren } from "preact";
import { useRef, useState } from "preact/hooks";
import { useWords } from "../i18n/index.ts";
import { Action } from "./action.tsx";

interface Props {
  /** What is changed, for who can't see where the button stands. */
  name: string;
  /** Of the button that opens it; "Change" unless told. */
  title?: string | undefined;
  /** Of what is changed: entries begin anew with another one, and never while somebody types. */
  version: number;
  send: (entered: FormData) => Promise<void>;
  children: ComponentChildren;
}

export function Edit({ name, title, version, send, children }: Props) {
  const { t } = useWords();
  const box = useRef<HTMLDetailsElement>(null);
  const [saved, setSaved] = useState(0);
  const done = async (entered: FormData) => {
    await send(entered);
    setSaved(saved + 1);
    if (box.current) box.current.open = false;
    box.current?.querySelector("summary")?.focus();
  };
  return (
    <div class="edit">
      <details ref={box}>
        <summary class="button">
          {title ?? t("edit.change")} <span class="unseen">{name}</span>
        </summary>
        <Action key={`${version} ${saved}`} button={t("edit.save")} send={done}>
          {children}
        </Action>
      </details>
      <span role="status" class="quiet small">
        {saved > 0 && t("edit.saved")}
      </span>
    </div>
  );
}

interface Entry {
  name: string;
  label: string;
  required?: boolean;
}

export const TextEntry = ({ name, label, value, required, most }: Entry & { value: string | null; most: number }) => (
  <label class="field">
    {label}
    <input name={name} defaultValue={value ?? ""} required={required} maxLength={most} autocomplete="off" />
  </label>
);

interface Amount extends Entry {
  value: number | null | undefined;
  unit: string;
  min?: number;
  max?: number;
}

export const NumberEntry = ({ name, label, value, unit, required, min, max }: Amount) => (
  <label class="field amount-entry">
    {label} ({unit})
    <input
      name={name}
      type="number"
      step="any"
      inputMode="decimal"
      defaultValue={value === null || value === undefined ? "" : String(Number(value.toPrecision(6)))}
      required={required}
      min={min}
      max={max}
    />
  </label>
);

interface Choice {
  value: string;
  text: string;
}

export const ChoiceEntry = ({ name, label, value, of }: Entry & { value: string; of: Choice[] }) => (
  <label class="field">
    {label}
    <select name={name}>
      {of.map((one) => (
        <option key={one.value} value={one.value} selected={one.value === value}>
          {one.text}
        </option>
      ))}
    </select>
  </label>
);

/** A number that was entered, null where none was. */
export const numberIn = (entered: FormData, name: string, factor = 1): number | null => {
  const text = String(entered.get(name) ?? "").trim();
  return text === "" ? null : Number(text) / factor;
};

/** A text that was entered, null where none was. */
export const textIn = (entered: FormData, name: string): string | null =>
  String(entered.get(name) ?? "").trim() || null;

/** How a version is named where something is changed. */
export const etag = ({ version }: { version: number }): string => `"${version}"`;
