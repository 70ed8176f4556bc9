/** Names and their values, side by side. */
export const Facts = ({ rows }: { rows: (string | undefined)[][] }) => (
  <dl class="facts">
    {rows.map(([name, value]) => (
      <div key={name}>
        <dt>{name}</dt>
        <dd>{value}</dd>
      </div>
    ))}
  </dl>
);
