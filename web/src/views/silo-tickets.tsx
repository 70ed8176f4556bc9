/** Weighbridge tickets: those that were entered, and a form for the next one. */
import { useState } from "preact/hooks";
import { atLeast } from "../context.ts";
import type { PageOf, Silo, Ticket } from "../data/answers.ts";
import { change } from "../data/client.ts";
import { changed, useResource } from "../data/resources.ts";
import { moment } from "../format/dates.ts";
import { mass } from "../format/numbers.ts";
import { useWords } from "../i18n/index.ts";
import { Action } from "../parts/action.tsx";
import { Amount } from "../parts/amount.tsx";

export function Tickets({ silo }: { silo: Silo }) {
  const { t, locale } = useWords();
  const path = `silos/${encodeURIComponent(silo.id)}/tickets`;
  const tickets = useResource<PageOf<Ticket>>(path, "ticket", `of:${silo.id}`);
  const rows = tickets.data?.items ?? [];
  const mayEnter = atLeast(silo.role, "operator");
  return (
    <>
      <p class="quiet small">{t("tickets.about")}</p>
      {mayEnter && <TicketForm path={path} />}
      {rows.length > 0 && (
        <div class="scroll">
          <table>
            <thead>
              <tr>
                <th scope="col">{t("tickets.time")}</th>
                <th scope="col" class="number">
                  {t("tickets.mass")}
                </th>
                <th scope="col">{t("tickets.number")}</th>
                <th scope="col">{t("tickets.by")}</th>
                {mayEnter && <td />}
              </tr>
            </thead>
            <tbody>
              {rows.map((ticket) => (
                <tr key={ticket.id}>
                  <td>{moment(locale, Date.parse(ticket.time), silo.zone)}</td>
                  <td class="number">
                    <Amount amount={mass(locale, ticket.mass_kg, null)} />
                  </td>
                  <td>{ticket.number}</td>
                  <td>{ticket.created_by}</td>
                  {mayEnter && (
                    <td>
                      <Withdraw path={path} ticket={ticket} />
                    </td>
                  )}
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      )}
      {tickets.data && rows.length === 0 && <p class="quiet">{t("tickets.none")}</p>}
    </>
  );
}

/** Takes back a ticket that was mistyped; the audit log keeps who did. */
function Withdraw({ path, ticket }: { path: string; ticket: Ticket }) {
  const { t } = useWords();
  return (
    <Action
      button={t("tickets.remove")}
      about={ticket.number ?? ""}
      send={async () => {
        await change("DELETE", `${path}/${encodeURIComponent(ticket.id)}`);
        changed((topics) => topics.includes("ticket"));
      }}
    />
  );
}

function TicketForm({ path }: { path: string }) {
  const { t } = useWords();
  const [sent, setSent] = useState(0);
  return (
    <Action
      key={sent}
      button={t("tickets.add")}
      send={async (entered) => {
        const time = new Date(String(entered.get("time"))).toISOString();
        const tonnes = Number(entered.get("mass"));
        await change("POST", path, { time, mass_kg: tonnes * 1000, number: String(entered.get("number")) || null });
        changed((topics) => topics.includes("ticket"));
        setSent(sent + 1);
      }}
    >
      <label class="field">
        {t("tickets.time")}
        <input name="time" type="datetime-local" required />
      </label>
      <label class="field">
        {t("tickets.mass")} (t)
        <input name="mass" type="number" min="0.001" step="0.001" required inputMode="decimal" />
      </label>
      <label class="field">
        {t("tickets.number")}
        <input name="number" maxLength={80} />
      </label>
    </Action>
  );
}
