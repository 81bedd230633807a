"use strict";
(() => {
  // Prove the bounds again, in another thread, from the numbers in the page.
  const text = (id) => document.getElementById(id).textContent;
  const numbers = JSON.parse(text("proof-numbers"));
  const button = document.getElementById("prove");
  const place = document.getElementById("proven");
  const answer = `onmessage = async ({ data }) => {
    try { postMessage({ found: await (data.pair ? verdictOnPair(...data.pair) : verdictOn(data)) }); }
    catch (error) { postMessage({ fault: String(error) }); }
  };`;

  function proved(halves) {
    const source = new Blob(['"use strict";\n', text("proof-checker"), answer]);
    const address = URL.createObjectURL(source);
    return new Promise((resolve, reject) => {
      const worker = new Worker(address);
      worker.onerror = (event) => reject(new Error(event.message || "the checker cannot start"));
      worker.onmessage = ({ data }) => (data.fault ? reject(new Error(data.fault)) : resolve(data.found));
      worker.postMessage(halves);
    }).finally(() => URL.revokeObjectURL(address));
  }

  button.addEventListener("click", async () => {
    button.disabled = true;
    place.replaceChildren();
    const entries = Object.entries(numbers), [below, above] = ["lower", "upper"].map((kind) => entries.filter(
      ([, halves]) => Object.keys(halves).join() === kind && halves[kind].numbers.strength_factor !== undefined));
    if (below.length === 1 && above.length === 1) {
      entries.push([`${below[0][0]} and ${above[0][0]}`, { pair: [below[0], above[0]] }]);
    }
    const found = {};
    for (const [name, of] of entries) {
      const halves = of.pair ? { pair: [...of.pair.map((file) => file[1]), ...of.pair.map((file) => found[file[0]])] } : of;
      const line = place.appendChild(document.createElement("p"));
      line.textContent = `${name}: the browser computes …`;
      const began = performance.now();
      try {
        const { sentence, digest } = found[name] = await proved(halves);
        const time = ((performance.now() - began) / 1000).toFixed(1);
        const hashed = of.pair ? "" : digest ? ` SHA-256 of the numbers: ${digest}.`
          : " This browser computes no SHA-256 here.";
        line.textContent = `${name}: ${sentence} (${time} s)${hashed}`;
      } catch (error) {
        line.textContent = `${name}: nothing is proven here (${error.message}).`;
      }
    }
    button.disabled = false;
    place.dataset.ready = "true";
  });
})();
