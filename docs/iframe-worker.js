// The worker of the search where pages are opened as files, to which browsers give no worker: its script runs in a hidden frame.
// The plugin `offline` would have a page load such a script from a network.
class FrameWorker extends EventTarget {
  constructor(script) {
    super();
    const frame = document.createElement("iframe");
    frame.hidden = true;
    document.body.append(frame);
    const inside = frame.contentDocument;
    // Otherwise some browsers replace the frame's first document, and what it was given with it.
    inside.open();
    inside.write("<!doctype html><title>search</title><body></body>");
    inside.close();
    this.window = frame.contentWindow;
    this.window.postMessage = data => this.dispatchEvent(new MessageEvent("message", { data }));
    const element = inside.createElement("script");
    element.src = script;
    this.ready = new Promise(loaded => { element.onload = loaded; });
    inside.body.append(element);
  }

  postMessage(data) {
    this.ready.then(() => this.window.dispatchEvent(new MessageEvent("message", { data })));
  }
}

if (location.protocol === "file:") window.Worker = FrameWorker;
