/** Server-sent events, read from a response's text: lines in, events out (WHATWG HTML, "Server-sent events"). */

export interface Event {
  id: string | null;
  type: string;
  data: string;
}

/** A parser that keeps what a piece of text leaves unfinished. */
export function parser(emit: (event: Event) => void): (text: string) => void {
  let rest = "";
  let id: string | null = null;
  let type = "";
  let data: string[] = [];

  const line = (text: string) => {
    if (text === "") {
      if (data.length) emit({ id, type: type || "message", data: data.join("\n") });
      type = "";
      data = [];
      return;
    }
    if (text.startsWith(":")) return;
    const colon = text.indexOf(":");
    const name = colon < 0 ? text : text.slice(0, colon);
    const value = colon < 0 ? "" : text.slice(colon + 1).replace(/^ /, "");
    if (name === "data") data.push(value);
    else if (name === "event") type = value;
    else if (name === "id" && !value.includes("\0")) id = value;
  };

  return (text) => {
    const lines = (rest + text).split(/\r\n|\n|\r(?!$)/);
    rest = lines.pop() ?? "";
    for (const one of lines) line(one);
  };
}

/** Waiting time before the next try: doubled each time, up to half a minute, by chance up to a quarter longer. */
export function backoff(tries: number, chance: number = Math.random()): number {
  return Math.min(30_000, 500 * 2 ** tries) * (1 + chance / 4);
}
