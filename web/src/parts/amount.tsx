/** A quantity with its deviation, in words that a screen reader says right. */
import { useWords } from "../i18n/index.ts";

interface Props {
  amount: { value: string; deviation: string | null; unit: string };
}

export function Amount({ amount: { value, deviation, unit } }: Props) {
  const { t } = useWords();
  return (
    <>
      {value}
      {deviation !== null && (
        <span class="deviation">
          <span class="unseen"> {t("amount.plusMinus")}</span>
          <span aria-hidden="true"> ± </span>
          {deviation}
        </span>
      )}{" "}
      {unit}
    </>
  );
}
