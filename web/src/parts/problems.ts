/** What a failed request tells people, in their language; the server's own sentence is English. */
import { Problem } from "../data/client.ts";
import type { Key, Words } from "../i18n/index.ts";

const BY_STATUS: Record<number, Key> = {
  403: "problem.forbidden",
  404: "problem.missing",
  409: "problem.conflict",
  412: "problem.changed",
  422: "problem.invalid",
  429: "login.tooMany",
};

export function told(error: unknown, { t, language }: Words): string {
  if (!(error instanceof Problem)) return t("link.failed");
  if (error.noLink) return t("link.none");
  return language === "en" ? error.message : t(BY_STATUS[error.status] ?? "link.failed");
}
