/** The use below the trend, bar by bar on the same time axis. */
import type { Span, Use } from "./trend-data.ts";

interface Props {
  uses: Use[];
  span: Span;
  label: string;
  text: (amount: number) => string;
}

const HEIGHT = 100;

export function UseBars({ uses, span, label, text }: Props) {
  const most = Math.max(...uses.map((use) => use.amount), 1e-9);
  const x = (time: number) => (1000 * (time - span.from)) / (span.to - span.from);
  return (
    <figure class="bars">
      <figcaption class="quiet small">
        {label} · <span>{uses.length ? `≤ ${text(most)}` : "–"}</span>
      </figcaption>
      <svg
        viewBox={`0 0 1000 ${HEIGHT}`}
        preserveAspectRatio="none"
        role="img"
        aria-label={`${label}: ≤ ${text(most)}`}
      >
        {uses
          .filter((use) => use.to > span.from)
          .map(({ from, to, amount }) => {
            const left = Math.max(0, x(from));
            const height = (HEIGHT * amount) / most;
            return (
              <rect key={from} x={left + 1} y={HEIGHT - height} width={Math.max(1, x(to) - left - 2)} height={height} />
            );
          })}
      </svg>
    </figure>
  );
}
