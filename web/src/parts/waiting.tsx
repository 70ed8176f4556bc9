/** In place of what has never come yet: waiting, or why it does not come. */
import type { Resource } from "../data/resources.ts";
import { useWords } from "../i18n/index.ts";
import { told } from "./problems.ts";

export function Waiting({ resource }: { resource: Resource<unknown> }) {
  const words = useWords();
  const { problem } = resource;
  const text = problem ? told(problem, words) : words.t("wait.loading");
  return (
    <main id="main" class="whole single" tabIndex={-1}>
      <p class="panel" role="status">
        {text}
      </p>
    </main>
  );
}
