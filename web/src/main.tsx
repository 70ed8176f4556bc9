import { render } from "preact";
import { App } from "./app.tsx";
import { load, preferred } from "./i18n/index.ts";
import "./styles/theme.css";
import "./styles/base.css";
import "./styles/page.css";
import { apply, chosen } from "./theme.ts";

apply(chosen());
const language = preferred();
void load(language).then((texts) => {
  const root = document.getElementById("app");
  if (root) render(<App start={{ language, texts }} />, root);
});
