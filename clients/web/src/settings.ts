/** What the browser remembers of how somebody has it, beside sheets. */

/** Return what this browser, or this tab alone, remembers; null if it does not. */
export function remembered(key: string, where: "browser" | "tab" = "browser"): string | null {
  try {
    return (where === "tab" ? sessionStorage : localStorage).getItem(key);
  } catch {
    return null; // it is told to remember nothing
  }
}

export function remember(key: string, value: string, where: "browser" | "tab" = "browser"): void {
  try {
    (where === "tab" ? sessionStorage : localStorage).setItem(key, value);
  } catch {
    // It holds for as long as the page is open.
  }
}
