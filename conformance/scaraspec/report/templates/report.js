// Language switch, search, filters and keyboard navigation; the page is readable without it.
"use strict";
{
  const STORED_LANGUAGE = "scaraspec.language";
  const root = document.documentElement;
  const buttons = [...document.querySelectorAll("[data-switch]")];
  const cases = [...document.querySelectorAll(".case")];
  const search = document.getElementById("search");
  const shown = document.getElementById("shown");
  const filters = [...document.querySelectorAll(".filters input")];
  const texts = new Map(); // lower-case text of a case, cached at the first search

  function setLanguage(language) {
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

  function applyFilters() {
    const searchWords = search.value.trim().toLowerCase().split(/\s+/).filter(Boolean);
    const verdicts = new Set(filters.filter((box) => box.checked).map((box) => box.value));
    let count = 0;
    for (const element of cases) {
      element.hidden =
        !verdicts.has(element.dataset.verdict) ||
        !searchWords.every((word) => textOf(element).includes(word));
      count += !element.hidden;
    }
    shown.value = count;
  }

  function move(step) {
    const visible = cases.filter((element) => !element.hidden);
    const at = visible.indexOf(document.activeElement.closest(".case"));
    const next = visible[at < 0 ? (step > 0 ? 0 : visible.length - 1) : at + step];
    if (!next) return;
    next.querySelector("summary").focus();
    next.scrollIntoView({ block: "nearest" });
  }

  function openLinkedCase() {
    const element = /^#case-\d+$/.test(location.hash) && document.querySelector(location.hash);
    if (!element) return;
    element.hidden = false;
    element.open = true;
    element.querySelector("summary").focus({ preventScroll: true });
    element.scrollIntoView();
  }

  // A browser may refuse to store anything for a local file.
  function rememberedLanguage() {
    try {
      const language = localStorage.getItem(STORED_LANGUAGE);
      return ["en", "zh"].includes(language) ? language : root.dataset.language;
    } catch {
      return root.dataset.language;
    }
  }

  function chooseLanguage(language) {
    setLanguage(language);
    try {
      localStorage.setItem(STORED_LANGUAGE, language);
    } catch {}
  }

  for (const button of buttons) button.addEventListener("click", () => chooseLanguage(button.dataset.switch));
  if (search) {
    search.addEventListener("input", applyFilters);
    for (const box of filters) box.addEventListener("change", applyFilters);
    applyFilters(); // a reloaded page keeps the search text
  }
  for (const button of document.querySelectorAll(".copy"))
    button.addEventListener("click", () =>
      navigator.clipboard?.writeText(button.previousElementSibling.textContent));

  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "Escape" && document.activeElement === search) search.blur();
    if (event.target.matches("input, button")) return; // the browser opens a summary on Enter
    if (event.key === "/" && search) {
      event.preventDefault();
      search.focus();
      search.select();
    }
    if (event.key === "j") move(1);
    if (event.key === "k") move(-1);
  });

  let opened = [];
  addEventListener("beforeprint", () => {
    opened = cases.filter((element) => !element.open && !["pass", "none"].includes(element.dataset.verdict));
    for (const element of opened) element.open = true;
  });
  addEventListener("afterprint", () => {
    for (const element of opened) element.open = false;
  });
  addEventListener("hashchange", openLinkedCase);
  setLanguage(rememberedLanguage());
  openLinkedCase();
}
