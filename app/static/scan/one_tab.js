// One tab at a time has the pages: of two that store them, one would write over what the other has shown.

const LOCK = "scan-pages";

/**
 * Calls `onChange(true)` when this tab has the pages, and `onChange(false)` while another one has them: this tab follows
 * when that one is closed. Returns a function that takes them over. Without locks (over plain HTTP) each tab has them.
 */
export function haveAlone(onChange) {
  const { locks } = navigator;
  if (!locks) {
    onChange(true);
    return () => {};
  }
  let waiting = null;
  const hold = () => {
    onChange(true);
    return new Promise(() => {}); // until the tab is closed, or another one takes over
  };
  const wait = () => {
    const own = (waiting = new AbortController());
    onChange(false);
    locks.request(LOCK, { signal: own.signal }, hold).catch(() => own.signal.aborted || wait());
  };
  locks.request(LOCK, { ifAvailable: true }, (lock) => (lock ? hold() : wait())).catch(wait);
  return () => {
    waiting?.abort();
    locks.request(LOCK, { steal: true }, hold).catch(wait);
  };
}
