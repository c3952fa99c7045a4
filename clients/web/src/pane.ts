/** What both panes share: how large they are, and how they are looked at. */

import { type Signal, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";

import { type Box, fitting, type View } from "./geometry";
import { refit } from "./state";

export interface Size {
  readonly width: number;
  readonly height: number;
}

export function useSize<T extends Element>() {
  const element = useRef<T>(null);
  const size = useSignal<Size>({ width: 0, height: 0 });
  useEffect(() => {
    const { current } = element;
    if (!current) return;
    const watching = new ResizeObserver(() => {
      const { width, height } = current.getBoundingClientRect();
      size.value = { width, height };
    });
    watching.observe(current);
    return () => watching.disconnect();
  }, []);
  return { element, size };
}

/** Show a box whole at first, whenever the pane changes its size, and whenever that is asked for. */
export function useView(
  size: Signal<Size>,
  box: () => Box | null,
  margin: number,
  most = Infinity,
): Signal<View> {
  const view = useSignal<View>({ x: 0, y: 0, scale: 1 });
  const { width, height } = size.value;
  const asked = refit.value;
  useEffect(() => {
    const shown = box();
    if (!width) return;
    if (!shown || !Number.isFinite(shown.x0)) {
      view.value = { x: 0, y: 0, scale: 1 };
      return;
    }
    const fitted = fitting(shown, width, height, margin);
    const scale = Math.min(fitted.scale, most);
    const [cx, cy] = [(shown.x0 + shown.x1) / 2, (shown.y0 + shown.y1) / 2];
    view.value = { scale, x: width / 2 - scale * cx, y: height / 2 - scale * cy };
  }, [width, height, asked]);
  return view;
}
