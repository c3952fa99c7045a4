/** The answer in words: what is what, how sure that is, and what to ask. */

import type { RequestFailed } from "@sketchmatch/client";
import { useEffect, useState } from "preact/hooks";

import type { Carried } from "./carry";
import { colourOf } from "./colours";
import { drawing } from "./document";
import { Icon } from "./icons";
import {
  alone,
  answered,
  asking,
  bridges,
  cancel,
  cancelled,
  carried,
  carryTrouble,
  elsewhere,
  isLit,
  leaveOut,
  lit,
  lookForRobots,
  mapName,
  matchNow,
  nameOfCarried,
  naming,
  type Pair,
  pairs,
  pin,
  pinOf,
  place,
  progress,
  question,
  radius,
  reading,
  readings,
  resize,
  robot,
  running,
  sending,
  sendRoutes,
  setRadius,
  sizeOf,
  sketchName,
  trouble,
  unit,
  wantsToken,
} from "./state";
import { language, type Texts, texts, told } from "./texts";

type Sureness = keyof Texts["words"];

export function AnswerPanel() {
  const t = texts.value;
  const found = answered.value;
  return (
    <section class="answer" id="answer" aria-labelledby="answer-title" tabIndex={-1}>
      <div class="panel-head">
        <h2 id="answer-title">{t.answer}</h2>
        {readings.value > 1 && <Pager />}
      </div>
      <div class="scroll" tabIndex={0}>
        <Headline />
        {asking.value !== null && <Asking index={asking.value} />}
        {found && asking.value === null && <Question />}
        {found && (
          <>
            <ul class="pairs" data-testid="pairs">
              {pairs.value.map((pair) => (
                <Line key={pair.sketch} pair={pair} />
              ))}
            </ul>
            <OnTheMap />
            <Unmatched />
          </>
        )}
      </div>
    </section>
  );
}

function Headline() {
  const t = texts.value;
  const found = answered.value;
  const failed = trouble.value;
  return (
    <div class="headline" aria-live="polite" data-testid="headline">
      {running.value && <Searching />}
      {!running.value && cancelled.value && (
        <div class="row">
          <p>{t.cancelled}</p>
          <button type="button" class="quiet" onClick={matchNow} data-testid="again">
            {t.again}
          </button>
        </div>
      )}
      {failed && !running.value ? (
        <div class="row">
          <p class="trouble">{failedText(failed)}</p>
          {wantsToken(failed) && (
            <button type="button" class="quiet" onClick={askForToken}>
              {t.connect}
            </button>
          )}
        </div>
      ) : found ? (
        <Verdict />
      ) : (
        !running.value &&
        !cancelled.value && (
          <p class="muted">{place.value?.things.length === 0 ? t.emptyMap : t.begin}</p>
        )
      )}
    </div>
  );
}

/** Show the dialog again that somebody has closed. */
function askForToken(): void {
  document.querySelector<HTMLDialogElement>("dialog#token-dialog")?.showModal();
}

function failedText(failed: RequestFailed): string {
  const t = texts.value;
  const { failure, reason } = failed;
  if (failure === "away") return t.away;
  if (failure === "busy") return t.busy;
  if (wantsToken(failed)) return t.token;
  if (reason === "TOO_FEW_OBJECTS" || reason === "INVALID_STROKE") return t.oneMore;
  return told(failed);
}

function Verdict() {
  const t = texts.value;
  const found = answered.value;
  if (!found) return null;
  if (elsewhere.value) {
    return (
      <div data-testid="elsewhere">
        <p class="verdict">{t.notThisPlace}</p>
        <p class="muted">{t.notThisPlaceHint}</p>
      </div>
    );
  }
  const of = found.sketched.length;
  const n = of - alone.value.sketch.length;
  const { probability } =
    reading.value === 0
      ? found.result
      : (found.result.alternatives[reading.value - 1] ?? { probability: undefined });
  return (
    <>
      <p class="verdict">{n === of ? t.foundAll(n) : t.found(n, of)}</p>
      {probability !== undefined && (
        <p class="muted">
          {t.whole[surenessOf(probability)]} <Percent share={probability} />
        </p>
      )}
    </>
  );
}

function Searching() {
  const t = texts.value;
  const told = progress.value;
  // What is over in a blink needs no sign of it.
  const long = (told?.seconds ?? 0) > 0.4 || told?.compiling;
  return (
    <div class={`searching${long ? " long" : ""}`}>
      <span class="row">
        <span class="muted">{told?.compiling ? t.compiling : t.searching}</span>
        <button type="button" class="quiet" onClick={cancel} data-testid="cancel">
          {t.cancel}
        </button>
      </span>
      {told && told.curve.length > 1 && long && <Curve />}
    </div>
  );
}

/** ζ of the best map so far, and the bound that no map exceeds, over time. */
function Curve() {
  const curve = progress.value?.curve ?? [];
  const end = curve.at(-1)?.seconds ?? 1;
  const path = (value: (k: number) => number | undefined) =>
    curve
      .map(({ seconds }, k) => [(260 * seconds) / end, value(k)] as const)
      .filter((point): point is readonly [number, number] => point[1] !== undefined)
      .map(([x, y]) => `${x.toFixed(1)},${(56 - 52 * y).toFixed(1)}`)
      .join(" ");
  return (
    <svg class="curve" viewBox="0 0 260 60" role="img" aria-label={texts.value.curve}>
      <polyline class="bound" points={path((k) => curve[k]?.bound)} />
      <polyline points={path((k) => curve[k]?.zeta)} />
    </svg>
  );
}

function Pager() {
  const t = texts.value;
  const step = (by: number) => {
    reading.value = (reading.value + by + readings.value) % readings.value;
  };
  return (
    <div class="pager" role="group" aria-label={t.alternatives}>
      <button type="button" class="tool small" onClick={() => step(-1)} aria-label={t.previous}>
        <Icon name="left" />
      </button>
      <span data-testid="reading">{t.reading(reading.value + 1, readings.value)}</span>
      <button type="button" class="tool small" onClick={() => step(1)} aria-label={t.next}>
        <Icon name="right" />
      </button>
    </div>
  );
}

/** Two readings fit: one question, and one tap answers it. */
function Question() {
  const t = texts.value;
  const asked = question.value;
  if (!asked || elsewhere.value || reading.value !== 0) return null;
  return (
    <div class="card" data-testid="question">
      <p class="verdict">{t.question(sketchName(asked.sketch))}</p>
      <p class="muted">
        {t.ambiguous(asked.maps)} {t.questionHint}
      </p>
      <div class="choices">
        {asked.candidates.map((map) => (
          <button
            type="button"
            key={map}
            class="choice"
            onClick={() => pin(asked.sketch, map)}
            onMouseEnter={() => (lit.value = { side: "map", index: map })}
            onMouseLeave={() => (lit.value = null)}
            onFocus={() => (lit.value = { side: "map", index: map })}
          >
            {mapName(map)}
          </button>
        ))}
        <button type="button" class="choice" onClick={() => pin(asked.sketch, null)}>
          {t.noneOfThese}
        </button>
      </div>
    </div>
  );
}

function Asking({ index }: { index: number }) {
  const t = texts.value;
  return (
    <div class="card" data-testid="asking">
      <div class="row">
        <p class="verdict">{t.tapToPin(sketchName(index))}</p>
        <button
          type="button"
          class="tool small"
          aria-label={t.close}
          onClick={() => {
            asking.value = null;
            lit.value = null;
          }}
        >
          <Icon name="close" />
        </button>
      </div>
      <Chooser index={index} />
      <Size index={index} />
    </div>
  );
}

/** How large a sketched thing is, for who would rather type it. */
function Size({ index }: { index: number }) {
  const t = texts.value;
  // What is being typed stays when an answer arrives, which shows the size anew.
  const [typing, setTyping] = useState<{ side: 0 | 1; text: string } | null>(null);
  const size = sizeOf(index);
  if (!size) return null;
  const side = (k: 0 | 1, name: string) => (
    <label>
      <span class="muted">{`${name}${unit.value && ` (${unit.value})`}`}</span>
      <input
        type="number"
        min="0.01"
        max="100000"
        step="any"
        data-testid={k ? "height" : "width"}
        value={typing?.side === k ? typing.text : Number(size[k].toPrecision(3))}
        onInput={({ currentTarget: { value } }) => setTyping({ side: k, text: value })}
        onBlur={() => setTyping(null)}
        onChange={({ currentTarget: { valueAsNumber: typed, validity } }) => {
          setTyping(null);
          const isOther = typed !== Number(size[k].toPrecision(3));
          if (validity.valid && Number.isFinite(typed) && isOther) {
            resize(index, k ? [size[0], typed] : [typed, size[1]]);
          }
        }}
      />
    </label>
  );
  return (
    <div class="row size">
      {side(0, t.width)}
      {side(1, t.height)}
    </div>
  );
}

/** What a sketched thing is, chosen without a pointer. */
function Chooser({ index }: { index: number }) {
  const t = texts.value;
  const found = answered.value;
  const said = found ? pinOf(found, index) : undefined;
  const things = place.value?.things ?? [];
  return (
    <select
      aria-label={t.changeTo(sketchName(index))}
      value={said === undefined ? "auto" : (said ?? "none")}
      onChange={({ currentTarget: { value } }) => {
        const map = things.findIndex(({ id }) => id === value);
        pin(index, value === "auto" ? undefined : value === "none" ? null : map);
      }}
    >
      <option value="auto">{t.automatic}</option>
      {things.map(({ id }, k) => (
        <option key={id} value={id}>
          {mapName(k)}
        </option>
      ))}
      <option value="none">{t.onNoMap}</option>
    </select>
  );
}

function Line({ pair }: { pair: Pair }) {
  const t = texts.value;
  const name = pair.all.sketch.map(sketchName).join(" + ");
  const mapped = pair.all.map.map(mapName).join(" + ");
  const isGroup = pair.all.sketch.length + pair.all.map.length > 2;
  const partner = isGroup ? t.asOne(mapped) : mapped;
  const isNamed = pair.all.sketch.some((k) => answered.value?.sketched[k]?.label);
  const light = () => (lit.value = { side: "sketch", index: pair.sketch });
  const sure = pair.probability === undefined ? null : surenessOf(pair.probability);
  const words = pair.pinned ? t.pinned : sure ? t.words[sure] : "";
  return (
    <li
      class={`pair${isLit("sketch", pair.sketch) ? " lit" : ""}`}
      onMouseEnter={light}
      onMouseLeave={() => (lit.value = null)}
    >
      <button
        type="button"
        class="line"
        data-testid={`pair-${pair.sketch}`}
        aria-pressed={asking.value === pair.sketch}
        aria-label={`${pair.sketch + 1}: ${name} ${t.is} ${partner}, ${words} ${percentText(pair.probability)}`}
        onFocus={light}
        onClick={() => (asking.value = asking.value === pair.sketch ? null : pair.sketch)}
      >
        <span class="dot" style={{ background: colourOf(pair.sketch) }}>
          {pair.sketch + 1}
        </span>
        <span class="names">
          <span class="partner">{partner}</span>
          {(isNamed || pair.all.sketch.length > 1) && <span class="muted">{name}</span>}
        </span>
        <span class="sure">
          {pair.pinned ? <Icon name="pin" /> : null}
          <span>{words}</span>
          {!pair.pinned && <Percent share={pair.probability} />}
        </span>
        <span class="bar">
          <span
            style={{
              inlineSize: `${Math.round(100 * (pair.pinned ? 1 : (pair.probability ?? 0)))}%`,
              background: colourOf(pair.sketch),
            }}
          />
        </span>
      </button>
    </li>
  );
}

/** What became of routes and zones on the way to the map. */
function OnTheMap() {
  const t = texts.value;
  if (!carried.value.length && !carryTrouble.value) return null;
  return (
    <section class="rest" data-testid="carried">
      <h3>{t.onTheMap}</h3>
      {carryTrouble.value && <p class="trouble">{carryTrouble.value}</p>}
      <ul class="carried">
        {carried.value.map((way) => (
          <li key={way.id}>
            <span class="row">
              <span>{nameOfCarried(way)}</span>
              <span class="muted">{within(way)}</span>
            </span>
            {[...new Set(way.changes.map(({ reason }) => reason))].map((reason) => (
              <p key={reason} class="muted">
                {t.changes[reason]}
              </p>
            ))}
          </li>
        ))}
      </ul>
      <label class="row radius">
        <span class="muted">{t.radius}</span>
        <input
          type="number"
          min="0"
          max="5"
          step="0.05"
          value={radius.value}
          data-testid="radius"
          onChange={({ currentTarget: { valueAsNumber, validity } }) => {
            if (validity.valid && Number.isFinite(valueAsNumber)) setRadius(valueAsNumber);
          }}
        />
      </label>
      <Sending />
    </section>
  );
}

/** To which robot a route is sent; only to those that whoever runs the server has named. */
function Sending() {
  const t = texts.value;
  useEffect(() => void lookForRobots(), []);
  const listed = bridges.value ?? [];
  const routes = carried.value.filter(({ kind, lines }) => kind === "route" && lines.length);
  if (!listed.length || !routes.length) return null;
  const { url, topic, frame } = robot.value;
  return (
    <form
      class="sending"
      onSubmit={(event) => {
        event.preventDefault();
        const said = new FormData(event.currentTarget);
        const text = (name: string) => String(said.get(name) ?? "").trim();
        void sendRoutes({ url: text("url"), topic: text("topic"), frame: text("frame") });
      }}
    >
      <label>
        <span class="muted">{t.robot}</span>
        <select name="url" value={listed.includes(url) ? url : listed[0]}>
          {listed.map((each) => (
            <option key={each}>{each}</option>
          ))}
        </select>
      </label>
      <div class="row">
        <label>
          <span class="muted">{t.topic}</span>
          <input name="topic" required pattern="/?[A-Za-z][A-Za-z0-9_\/]*" defaultValue={topic} />
        </label>
        <label>
          <span class="muted">{t.frame}</span>
          <input name="frame" required pattern="\S+" defaultValue={frame} />
        </label>
      </div>
      <button type="submit" class="primary" disabled={sending.value} data-testid="send">
        {t.send}
      </button>
    </form>
  );
}

function within({ lines }: Carried): string {
  const t = texts.value;
  if (!lines.length) return t.nowhere;
  const most = Math.max(0, ...lines.flatMap(({ deviations }) => deviations));
  const metres = most.toLocaleString(language.value, { maximumFractionDigits: 2 });
  return t.within(`${metres} ${unit.value}`.trim());
}

function Unmatched() {
  const t = texts.value;
  const { sketch, map } = alone.value;
  if (elsewhere.value) return null;
  return (
    <>
      {sketch.length > 0 && (
        <section class="rest">
          <h3>{t.notFound}</h3>
          <ul class="chips" data-testid="not-found">
            {sketch.map((k) => (
              <li key={k}>
                <button
                  type="button"
                  class="chip"
                  onClick={() => (asking.value = k)}
                  onFocus={() => (lit.value = { side: "sketch", index: k })}
                >
                  {k + 1}. {sketchName(k)}
                </button>
              </li>
            ))}
          </ul>
        </section>
      )}
      {map.length > 0 && (
        <section class="rest">
          <h3>{t.notDrawn}</h3>
          <ul class="chips" data-testid="not-drawn">
            {map.map((k) => (
              <li key={k} class="chip still">
                <span
                  onMouseEnter={() => (lit.value = { side: "map", index: k })}
                  onMouseLeave={() => (lit.value = null)}
                >
                  {mapName(k)}
                </span>
                {!place.value?.place && (
                  <button
                    type="button"
                    class="cross"
                    aria-label={`${t.leaveOut}: ${mapName(k)}`}
                    onClick={() => void leaveOut(new Set([k]))}
                  >
                    <Icon name="close" />
                  </button>
                )}
              </li>
            ))}
          </ul>
        </section>
      )}
    </>
  );
}

function Percent({ share }: { share: number | undefined }) {
  return <span class="percent">{percentText(share)}</span>;
}

function percentText(share: number | undefined): string {
  if (share === undefined) return "";
  // Nobody is wholly sure.
  return `${Math.min(99, Math.max(1, Math.round(100 * share)))} %`;
}

function surenessOf(probability: number): Sureness {
  if (probability >= 0.9) return "sure";
  if (probability >= 0.65) return "likely";
  return probability >= 0.35 ? "perhaps" : "guess";
}

/** Return the name that the strokes that are being named have. */
export function currentName(): string {
  const ids = naming.value ?? [];
  return drawing.value.strokes.find(({ id }) => ids.includes(id))?.label ?? "";
}
