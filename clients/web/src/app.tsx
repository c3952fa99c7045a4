/** The page. */

import { useEffect, useRef } from "preact/hooks";

import { AnswerPanel, currentName } from "./answer";
import { geoJson, waypoints } from "./carry";
import { canRedo, canUndo, drawing, LONGEST_NAME, nameStrokes, redo, undo } from "./document";
import { download, drawingExcalidraw, drawingSvg, strokesJson } from "./files";
import { Icon, type IconName } from "./icons";
import { MapPane } from "./map";
import { Mending } from "./mending";
import { isPlace, PLACES } from "./maps";
import { pictureSvg, pngOf } from "./picture";
import { SketchPane } from "./sketch";
import { Tuning } from "./tuning";
import {
  asking,
  bringMap,
  bringSketch,
  canBeLinked,
  carried,
  choose,
  choosePlace,
  chooseStored,
  fingerDraws,
  keepShown,
  link,
  lookForStored,
  mending,
  naming,
  newSheet,
  notice,
  place,
  refit,
  showToken,
  storedMaps,
  storeTrouble,
  theme,
  type Theme,
  type Tool,
  tool,
  trouble,
  wantsToken,
} from "./state";
import { type Language, language, LANGUAGES, speak, texts } from "./texts";

const TOOLS: readonly (readonly [Tool, string])[] = [
  ["pen", "P"],
  ["route", "R"],
  ["zone", "Z"],
  ["eraser", "E"],
  ["move", "V"],
  ["name", "N"],
];

export function App() {
  const t = texts.value;
  useEffect(() => {
    document.documentElement.lang = language.value;
  }, [language.value]);
  useEffect(() => {
    window.addEventListener("keydown", pressed);
    // A browser would leave the page for a file that falls beside the map.
    for (const name of ["dragover", "drop"] as const) {
      window.addEventListener(name, (event) => event.preventDefault());
    }
    return () => window.removeEventListener("keydown", pressed);
  }, []);
  return (
    <>
      <a class="skip" href="#answer">
        {t.skip}
      </a>
      <header class="top">
        <h1>
          <img src="icon.svg" alt="" width="26" height="26" />
          sketchmatch
        </h1>
        <p class="tagline">{t.tagline}</p>
        <div class="menus">
          <PlaceMenu />
          <FileMenu />
          <SettingsMenu />
        </div>
      </header>
      <main class="board">
        <section class="pane sketch-pane" aria-labelledby="sketch-title">
          <div class="panel-head">
            <h2 id="sketch-title">{t.sketch}</h2>
            <History />
          </div>
          <SketchPane />
          <Toolbar />
        </section>
        <section class="pane map-pane" aria-labelledby="map-title">
          <div class="panel-head">
            <h2 id="map-title">{t.map}</h2>
            <span class="muted title">{titleOfMap()}</span>
            {place.value && (
              <button
                type="button"
                class="quiet"
                aria-pressed={mending.value !== null}
                aria-label={t.mend}
                title={t.mend}
                data-testid="mend"
                onClick={() => (mending.value = mending.value ? null : new Set())}
              >
                <Icon name="mend" />
              </button>
            )}
            {canBeFoundOtherwise() && (
              <Menu id="tuning" icon="settings" label={t.tuning}>
                <Tuning />
              </Menu>
            )}
          </div>
          <MapPane />
          {mending.value && <Mending chosen={mending.value} />}
        </section>
        <AnswerPanel />
      </main>
      <Notice />
      <NameDialog />
      <TokenDialog />
    </>
  );
}

function titleOfMap(): string {
  const map = place.value;
  if (!map) return "";
  return isPlace(map.place) ? texts.value.place[map.place] : map.title;
}

function pressed(event: KeyboardEvent): void {
  if ((event.target as Element).closest("input,select,textarea,dialog")) return;
  const key = event.key.toLowerCase();
  if (event.ctrlKey || event.metaKey) {
    if (key === "z") (event.shiftKey ? redo : undo)();
    else if (key === "y") redo();
    else return;
    event.preventDefault();
    return;
  }
  if (key === "escape") [asking.value, mending.value] = [null, null];
  const chosen = TOOLS.find(([, letter]) => letter.toLowerCase() === key);
  if (chosen && !event.altKey) tool.value = chosen[0];
}

function Toolbar() {
  const t = texts.value;
  return (
    <div class="toolbar" role="toolbar" aria-label={t.tools}>
      {TOOLS.map(([name, letter]) => (
        <button
          type="button"
          key={name}
          class="tool"
          aria-pressed={tool.value === name}
          title={`${t[name]} (${letter})`}
          aria-label={t[name]}
          data-testid={`tool-${name}`}
          onClick={() => (tool.value = name)}
        >
          <Icon name={name} />
          <span class="tool-name">{t[name]}</span>
        </button>
      ))}
      <span class="gap" />
      <button
        type="button"
        class="tool touch-only"
        aria-pressed={fingerDraws.value}
        title={t.fingerDrawsHint}
        aria-label={t.fingerDraws}
        data-testid="finger-draws"
        onClick={() => (fingerDraws.value = !fingerDraws.value)}
      >
        <Icon name="finger" />
      </button>
    </div>
  );
}

function History() {
  const t = texts.value;
  const action = (icon: IconName, name: string, act: () => void, can = true) => (
    <button
      type="button"
      class="tool small"
      title={name}
      aria-label={name}
      disabled={!can}
      onClick={act}
      data-testid={icon}
    >
      <Icon name={icon} />
    </button>
  );
  return (
    <div class="history">
      {action("undo", t.undo, undo, canUndo.value)}
      {action("redo", t.redo, redo, canRedo.value)}
      {action("clear", t.clear, newSheet, drawing.value.strokes.length > 0)}
      {action("fit", t.fit, () => refit.value++)}
    </div>
  );
}

function Menu(props: {
  id: string;
  icon: IconName;
  label: string;
  opened?: () => void;
  children: preact.ComponentChildren;
}) {
  return (
    <div class="menu">
      <button
        type="button"
        class="quiet"
        popovertarget={props.id}
        data-testid={`open-${props.id}`}
        aria-label={props.label}
      >
        <Icon name={props.icon} />
        <span class="menu-name">{props.label}</span>
      </button>
      <div
        id={props.id}
        popover="auto"
        class="sheet"
        onToggle={({ newState }) => newState === "open" && props.opened?.()}
      >
        {props.children}
      </div>
    </div>
  );
}

/** Of the gallery, and where somebody has put right what was found, things stay as they are. */
function canBeFoundOtherwise(): boolean {
  const { place: name, found, things } = place.value ?? {};
  return !isPlace(name ?? "") && (!!found?.segmenter || things?.length === 0);
}

function shut(id: string): void {
  document.getElementById(id)?.hidePopover();
}

function PlaceMenu() {
  const t = texts.value;
  return (
    <Menu id="places" icon="map" label={t.chooseMap} opened={() => void lookForStored()}>
      <h2>{t.places}</h2>
      <ul class="gallery">
        {PLACES.map((name) => (
          <li key={name}>
            <button
              type="button"
              data-testid={`place-${name}`}
              aria-pressed={place.value?.place === name}
              onClick={() => {
                shut("places");
                void choosePlace(name);
              }}
            >
              <img src={`places/${name}/map.png`} alt="" loading="lazy" />
              <span>{t.place[name]}</span>
            </button>
          </li>
        ))}
      </ul>
      <FileButton
        label={t.ownMap}
        hint={t.ownMapHint}
        testId="map-file"
        multiple
        chosen={(files) => {
          shut("places");
          void bringMap(files);
        }}
      />
      <StoredMaps />
    </Menu>
  );
}

function StoredMaps() {
  const t = texts.value;
  const [map, stored] = [place.value, storedMaps.value];
  if (storeTrouble.value) {
    return (
      <>
        <h2>{t.stored}</h2>
        <p class="trouble" data-testid="store-trouble">
          {storeTrouble.value}
        </p>
      </>
    );
  }
  if (!stored) return null;
  return (
    <>
      {map && !isPlace(map.place) && !map.found.stored && (
        <form
          class="row keep"
          onSubmit={(event) => {
            event.preventDefault();
            const title = new FormData(event.currentTarget).get("title");
            shut("places");
            if (typeof title === "string") void keepShown(title.trim() || map.title);
          }}
        >
          <input
            key={map.title}
            name="title"
            aria-label={t.keepMapAs}
            defaultValue={map.title}
            maxLength={LONGEST_NAME}
            autocomplete="off"
          />
          <button type="submit" class="quiet" data-testid="keep-map">
            {t.keepMap}
          </button>
        </form>
      )}
      {stored.length > 0 && <h2>{t.stored}</h2>}
      {stored.map((each) => (
        <button
          key={each.name}
          type="button"
          class="item"
          data-testid="stored-map"
          aria-pressed={map?.found.stored === each.name}
          onClick={() => {
            shut("places");
            void chooseStored(each);
          }}
        >
          <span>{each.title}</span>
          <span class="muted">{t.things(each.things)}</span>
        </button>
      ))}
    </>
  );
}

function FileButton(props: {
  label: string;
  hint: string;
  testId: string;
  multiple?: boolean;
  chosen: (files: File[]) => void;
}) {
  const input = useRef<HTMLInputElement>(null);
  return (
    <>
      <button type="button" class="item" onClick={() => input.current?.click()}>
        <span>{props.label}</span>
        <span class="muted">{props.hint}</span>
      </button>
      <input
        ref={input}
        type="file"
        hidden
        multiple={props.multiple ?? false}
        data-testid={props.testId}
        onChange={({ currentTarget }) => {
          const files = [...(currentTarget.files ?? [])];
          currentTarget.value = "";
          if (files.length) props.chosen(files);
        }}
      />
    </>
  );
}

function FileMenu() {
  const t = texts.value;
  const drawn = drawing.value.strokes.length > 0;
  const item = (name: string, act: () => void, can: boolean, testId: string) => (
    <button
      type="button"
      class="item"
      disabled={!can}
      data-testid={testId}
      onClick={() => {
        shut("file");
        act();
      }}
    >
      {name}
    </button>
  );
  const save = (name: string, kind: string, text: string) =>
    download(name, new Blob([text], { type: kind }));
  return (
    <Menu id="file" icon="file" label={t.file}>
      <FileButton
        label={t.openSketch}
        hint={t.openSketchHint}
        testId="sketch-file"
        chosen={([file]) => {
          shut("file");
          if (file) void bringSketch(file);
        }}
      />
      <hr />
      {item(
        t.saveStrokes,
        () => save("sketch.json", "application/json", strokesJson(drawing.peek())),
        drawn,
        "save-strokes",
      )}
      {item(
        t.saveSvg,
        () => save("sketch.svg", "image/svg+xml", drawingSvg(drawing.peek())),
        drawn,
        "save-svg",
      )}
      {item(
        t.saveExcalidraw,
        () => save("sketch.excalidraw", "application/json", drawingExcalidraw(drawing.peek())),
        drawn,
        "save-excalidraw",
      )}
      {item(t.savePictureSvg, () => void savePicture("svg"), drawn, "save-picture-svg")}
      {item(t.savePicturePng, () => void savePicture("png"), drawn, "save-picture-png")}
      {item(
        t.saveCarried,
        () => save("routes.geojson", "application/geo+json", geoJson(carried.peek())),
        carried.value.length > 0,
        "save-carried",
      )}
      {item(
        t.saveWaypoints,
        () => save("waypoints.yaml", "application/yaml", waypoints(carried.peek())),
        carried.value.some(({ kind, lines }) => kind === "route" && lines.length > 0),
        "save-waypoints",
      )}
      <hr />
      {item(t.copyLink, () => void copyLink(), drawn && canBeLinked.value, "copy-link")}
    </Menu>
  );
}

async function savePicture(kind: "svg" | "png"): Promise<void> {
  const svg = await pictureSvg();
  const picture = kind === "svg" ? new Blob([svg], { type: "image/svg+xml" }) : await pngOf(svg);
  if (picture) download(`sketchmatch.${kind}`, picture);
}

async function copyLink(): Promise<void> {
  const address = await link();
  try {
    await navigator.clipboard.writeText(address);
    notice.value = texts.peek().linkCopied;
  } catch {
    notice.value = address; // a page that is not trusted may not copy
  }
}

function SettingsMenu() {
  const t = texts.value;
  return (
    <Menu id="settings" icon="settings" label={t.settings}>
      <fieldset>
        <legend>{t.languages}</legend>
        {(Object.keys(LANGUAGES) as Language[]).map((name) => (
          <label key={name} lang={name}>
            <input
              type="radio"
              name="language"
              checked={language.value === name}
              onChange={() => speak(name)}
            />
            {LANGUAGES[name].language}
          </label>
        ))}
      </fieldset>
      <fieldset>
        <legend>{t.theme}</legend>
        {(Object.keys(t.themes) as Theme[]).map((name) => (
          <label key={name}>
            <input
              type="radio"
              name="theme"
              checked={theme.value === name}
              onChange={() => choose(name)}
            />
            {t.themes[name]}
          </label>
        ))}
      </fieldset>
    </Menu>
  );
}

function Notice() {
  if (!notice.value) return null;
  return (
    <div class="notice" role="alert" data-testid="notice">
      <p>{notice.value}</p>
      <button
        type="button"
        class="tool small"
        aria-label={texts.value.close}
        onClick={() => (notice.value = "")}
      >
        <Icon name="close" />
      </button>
    </div>
  );
}

function NameDialog() {
  const t = texts.value;
  const dialog = useRef<HTMLDialogElement>(null);
  const ids = naming.value;
  useEffect(() => {
    if (ids) dialog.current?.showModal();
    else dialog.current?.close();
  }, [ids]);
  const names = new Set((place.value?.things ?? []).map(({ label }) => label).filter(Boolean));
  return (
    <dialog ref={dialog} onClose={() => (naming.value = null)} aria-labelledby="name-title">
      {ids && (
        <form
          method="dialog"
          onSubmit={({ currentTarget }) => {
            const name = new FormData(currentTarget).get("name");
            nameStrokes(new Set(ids), typeof name === "string" ? name.trim() : "");
          }}
        >
          <h2 id="name-title">{t.nameIt}</h2>
          <input
            name="name"
            list="names"
            aria-labelledby="name-title"
            defaultValue={currentName()}
            autocomplete="off"
            maxLength={LONGEST_NAME}
          />
          <datalist id="names">
            {[...names].map((name) => (
              <option key={name} value={name} />
            ))}
          </datalist>
          <p class="muted">{t.nameHint}</p>
          <button type="submit" class="primary">
            {t.save}
          </button>
        </form>
      )}
    </dialog>
  );
}

function TokenDialog() {
  const t = texts.value;
  const dialog = useRef<HTMLDialogElement>(null);
  const wanted = wantsToken(trouble.value);
  useEffect(() => {
    if (wanted) dialog.current?.showModal();
    else dialog.current?.close();
  }, [wanted]);
  return (
    <dialog ref={dialog} id="token-dialog" aria-labelledby="token-title">
      {wanted && (
        <form
          method="dialog"
          onSubmit={({ currentTarget }) => {
            const token = new FormData(currentTarget).get("token");
            if (typeof token === "string") showToken(token);
          }}
        >
          <h2 id="token-title">{t.token}</h2>
          <input name="token" type="password" aria-labelledby="token-title" autocomplete="off" />
          <p class="muted">{t.tokenHint}</p>
          <button type="submit" class="primary">
            {t.connect}
          </button>
        </form>
      )}
    </dialog>
  );
}
