// What the scan screen remembers in this browser: pages, the files of their photos, and what holds for all of them.

const STORES = ["pages", "files", "settings"];
const SETTINGS = "all"; // key of the only entry of its store
let opened = null;

function database() {
  opened ??= new Promise((resolve, reject) => {
    const asked = indexedDB.open("scan", 1);
    asked.onupgradeneeded = () => STORES.forEach((name) => asked.result.createObjectStore(name));
    asked.onsuccess = () => resolve(asked.result);
    asked.onerror = () => reject(asked.error);
  });
  return opened;
}

/** The result of one action on a store. Where the browser keeps nothing (a private window, a full disk): undefined. */
async function act(store, mode, action) {
  try {
    const transaction = (await database()).transaction(store, mode);
    return await new Promise((resolve, reject) => {
      const asked = action(transaction.objectStore(store));
      transaction.oncomplete = () => resolve(asked.result);
      transaction.onerror = transaction.onabort = () => reject(transaction.error);
    });
  } catch {
    return undefined;
  }
}

export const storedPages = async () => (await act("pages", "readonly", (store) => store.getAll())) ?? [];
export const storePage = (page) => act("pages", "readwrite", (store) => store.put(page, page.key));
export const storedSettings = () => act("settings", "readonly", (store) => store.get(SETTINGS));
export const storeSettings = (settings) => act("settings", "readwrite", (store) => store.put(settings, SETTINGS));

const held = new Map(); // files of this visit, where the browser keeps none

/** The files of a page's photos. */
export async function filesOf(key) {
  return held.get(key) ?? (await act("files", "readonly", (store) => store.get(key))) ?? [];
}

export function storeFiles(key, files) {
  held.set(key, files);
  return act("files", "readwrite", (store) => store.put(files, key));
}

export const forgetPage = (key) => act("pages", "readwrite", (store) => store.delete(key));

export async function forgetFiles(key) {
  held.delete(key);
  await act("files", "readwrite", (store) => store.delete(key));
}
