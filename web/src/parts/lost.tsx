/** Says that the link is lost, and of when the data are that still stand on the page. */
import { useNow } from "../context.ts";
import { newest } from "../data/resources.ts";
import { age } from "../format/dates.ts";
import { useWords } from "../i18n/index.ts";

export function Lost() {
  const { t, locale } = useWords();
  const now = useNow();
  const at = newest();
  return (
    <p class="lost" role="status">
      {t("link.lost")} {at !== null && t("link.dataFrom", { age: age(locale, (now - at) / 1000) })}
    </p>
  );
}
