// Switches the language, searches, filters, and moves by keyboard; without it the page still reads.
"use strict";
{
  const root = document.documentElement;
  const buttons = [...document.querySelectorAll("[data-switch]")];
  const cases = [...document.querySelectorAll(".case")];
  const search = document.getElementById("search");
  const shown = document.getElementById("shown");
  const filters = [...document.querySelectorAll(".filters input")];
  const texts = new Map(); // lower-case text of a case, made when it is first searched

  function speak(language) {
    root.lang = root.dataset.language = language;
    for (const element of document.querySelectorAll("[data-attribute]"))
      element.setAttribute(element.dataset.attribute, element.dataset[language]);
    for (const button of buttons)
      button.setAttribute("aria-pressed", button.dataset.switch === language);
  }

  function textOf(element) {
    if (!texts.has(element)) texts.set(element, element.textContent.toLowerCase());
    return texts.get(element);
  }

  function select() {
    const wanted = search.value.trim().toLowerCase().split(/\s+/).filter(Boolean);
    const verdicts = new Set(filters.filter((box) => box.checked).map((box) => box.value));
    let count = 0;
    for (const element of cases) {
      element.hidden =
        !verdicts.has(element.dataset.verdict) ||
        !wanted.every((word) => textOf(element).includes(word));
      count += !element.hidden;
    }
    shown.value = count;
  }

  function move(step) {
    const open = cases.filter((element) => !element.hidden);
    const at = open.indexOf(document.activeElement.closest(".case"));
    const next = open[at < 0 ? (step > 0 ? 0 : open.length - 1) : at + step];
    if (!next) return;
    next.querySelector("summary").focus();
    next.scrollIntoView({ block: "nearest" });
  }

  function reveal() {
    const element = /^#case-\d+$/.test(location.hash) && document.querySelector(location.hash);
    if (!element) return;
    element.hidden = false;
    element.open = true;
    element.querySelector("summary").focus({ preventScroll: true });
    element.scrollIntoView();
  }

  for (const button of buttons) button.addEventListener("click", () => speak(button.dataset.switch));
  if (search) {
    search.addEventListener("input", select);
    for (const box of filters) box.addEventListener("change", select);
    select(); // a reloaded page keeps what was typed
  }
  for (const button of document.querySelectorAll(".copy"))
    button.addEventListener("click", () =>
      navigator.clipboard?.writeText(button.previousElementSibling.textContent));

  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "Escape" && document.activeElement === search) search.blur();
    if (event.target.matches("input, button")) return; // Enter on a summary unfolds by itself
    if (event.key === "/" && search) {
      event.preventDefault();
      search.focus();
      search.select();
    }
    if (event.key === "j") move(1);
    if (event.key === "k") move(-1);
  });

  let folded = [];
  addEventListener("beforeprint", () => {
    folded = cases.filter((element) => !element.open && element.dataset.verdict !== "pass");
    for (const element of folded) element.open = true;
  });
  addEventListener("afterprint", () => {
    for (const element of folded) element.open = false;
  });
  addEventListener("hashchange", reveal);
  speak(root.dataset.language);
  reveal();
}
