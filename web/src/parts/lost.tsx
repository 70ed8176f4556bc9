/** What is wrong with the service itself, above everything: the link is lost, the disk has no room. */
import { useNow } from "../context.ts";
import type { Site } from "../data/answers.ts";
import { newest } from "../data/resources.ts";
import { age } from "../format/dates.ts";
import { bytes } from "../format/numbers.ts";
import { useWords } from "../i18n/index.ts";

/** Says of when the data are that still stand on the page. */
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

export function Short({ site }: { site: Site }) {
  const { t, locale } = useWords();
  return (
    <p class="lost" role="status">
      {t("machine.short", { free: bytes(locale, site.disk_free_bytes) })}
    </p>
  );
}
