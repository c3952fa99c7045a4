/** Colours of pairs: calm, apart from each other, and white reads well on each. */

const COLOURS = [
  "#2f6db3",
  "#b5532b",
  "#2d7a59",
  "#8b4d9e",
  "#936600",
  "#b03a5c",
  "#1c7686",
  "#5a6b2f",
  "#4a55a8",
  "#7d5a45",
  "#56697a",
  "#9a4a3a",
];

/** Return the colour of a pair, by its sketched thing. */
export function colourOf(index: number): string {
  return COLOURS[index % COLOURS.length] ?? "#56697a";
}
