/** The service's answers by the names that the page uses. */
export type * from "./types.ts";

/** Some of many, with the cursor of what follows. */
export interface PageOf<T> {
  items: T[];
  next: string | null;
}
