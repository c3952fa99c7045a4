/** The things of the map put right by hand: merged, left out and named. */

import {
  canUnmend,
  leaveOut,
  lit,
  mapName,
  mending,
  mergeThings,
  nameThing,
  place,
  unmend,
} from "./state";
import { texts } from "./texts";

export function Mending({ chosen }: { chosen: ReadonlySet<number> }) {
  const t = texts.value;
  const things = place.value?.things ?? [];
  const [only] = chosen.size === 1 ? chosen : [];
  const action = (name: string, act: () => void, can: boolean, testId: string) => (
    <button type="button" class="quiet" disabled={!can} data-testid={testId} onClick={act}>
      {name}
    </button>
  );
  return (
    <div class="mending" role="group" aria-label={t.mend} data-testid="mending">
      <p class="muted">{t.mendHint}</p>
      <ul class="chips">
        {things.map(({ id }, k) => (
          <li key={id}>
            <button
              type="button"
              class="chip"
              aria-pressed={chosen.has(k)}
              data-testid={`mend-${k}`}
              onMouseEnter={() => (lit.value = { side: "map", index: k })}
              onMouseLeave={() => (lit.value = null)}
              onFocus={() => (lit.value = { side: "map", index: k })}
              onClick={() => (mending.value = toggled(chosen, k))}
            >
              {mapName(k)}
            </button>
          </li>
        ))}
      </ul>
      {only !== undefined && (
        <form
          key={only}
          class="row keep"
          onSubmit={(event) => {
            event.preventDefault();
            const label = new FormData(event.currentTarget).get("label");
            if (typeof label === "string") void nameThing(only, label.trim());
          }}
        >
          <input
            name="label"
            aria-label={t.mapThingName}
            defaultValue={things[only]?.label ?? ""}
            maxLength={80}
            autocomplete="off"
          />
          <button type="submit" class="quiet" data-testid="mend-name">
            {t.rename}
          </button>
        </form>
      )}
      <div class="acts">
        {action(t.merge, () => void mergeThings(chosen), chosen.size > 1, "mend-merge")}
        {action(
          t.leaveOut,
          () => void leaveOut(chosen),
          chosen.size > 0 && things.length - chosen.size > 1,
          "mend-leave-out",
        )}
        {action(t.unmend, unmend, canUnmend.value, "mend-undo")}
      </div>
    </div>
  );
}

export function toggled(chosen: ReadonlySet<number>, index: number): ReadonlySet<number> {
  const others = new Set(chosen);
  if (!others.delete(index)) others.add(index);
  return others;
}
