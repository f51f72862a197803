// Shows the page without a network: its own files as they were last, everything else as without this worker.

const CACHE = "page-{version}";
const FILES = {files};
const SCOPE = new URL(self.registration.scope);

/** Addresses of the page's own files, within the scope. */
const isOwn = ({ origin, pathname }) => origin === SCOPE.origin && (pathname === SCOPE.pathname || FILES.some((file) => pathname === SCOPE.pathname + file));

self.addEventListener("install", (event) => {
  const all = ["", ...FILES].map((file) => new Request(new URL(file, SCOPE), { cache: "no-cache" }));
  event.waitUntil(caches.open(CACHE).then((cache) => cache.addAll(all)).then(() => self.skipWaiting()));
});

self.addEventListener("activate", (event) => {
  const older = (names) => names.filter((name) => name !== CACHE).map((name) => caches.delete(name));
  event.waitUntil(caches.keys().then((names) => Promise.all(older(names))).then(() => self.clients.claim()));
});

self.addEventListener("fetch", (event) => {
  const { request } = event;
  if (request.method === "GET" && isOwn(new URL(request.url))) event.respondWith(newest(request));
});

/** The file from the service; where it cannot be reached, as it was last. */
async function newest(request) {
  const cache = await caches.open(CACHE);
  try {
    const response = await fetch(request);
    if (response.ok) await cache.put(request, response.clone());
    return response;
  } catch (error) {
    return (await cache.match(request, { ignoreSearch: true })) ?? Promise.reject(error);
  }
}
