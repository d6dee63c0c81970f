"""`scaraspec verify --certificate`: the page, the packages that have one, and hostile text on
it."""

import hashlib
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest
from certification import ICS, Verify, certification_of, certified
from wording import ROOT

from scaraspec.api import verify_package
from scaraspec.api.certificates import PackageError, write_certificate, write_package
from scaraspec.certificate.mandatory import MandatoryList
from scaraspec.judge.verdicts import Conclusion, Verdict
from scaraspec.mutants.controller import mutants
from scaraspec.register import DOCUMENT_SHA256
from scaraspec.report.certificate import Certificate, render
from scaraspec.report.files import write_new
from scaraspec.report.texts import TEXTS
from scaraspec.translation import Language, translate

HOSTILE = "</dd><script>alert(1)</script>\u202e\x00"


@pytest.fixture(scope="module")
def certificate(package: Path, small_list: MandatoryList) -> Certificate:
    found = verify_package(package, lists=[small_list]).certificate
    assert found
    return found


class _Reader(HTMLParser):
    """The tags of a page, and its text in one language."""

    def __init__(self, page: str, language: str = "en") -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.text = ""
        other = {"en": "zh", "zh": "en"}[language]
        self.feed(re.sub(f'<span class="{other}" lang="{other}">.*?</span>', "", page))
        self.text = " ".join(self.text.split())

    def handle_starttag(self, tag: str, _: object) -> None:
        self.tags.add(tag)

    def handle_data(self, data: str) -> None:
        self.text += f" {data}"


def test_test_report(
    verify: Verify, package: Path, small_list: MandatoryList, tmp_path: Path
) -> None:
    """The result "no violation found" gives a test report with all details."""
    page = tmp_path / "page.html"
    status, text = verify(package, "--certificate", page)
    assert (status, text.splitlines()[-1]) == (0, f"{page}: written")
    shown = _Reader(page.read_text("utf-8")).text
    for each in (
        "Test report",
        "No violation found Cell 7 1.4 Nothing is violated",
        "7 of 9 requirements in scope were judged.",
        "This result relates only to the sample tested.",
        "System under test Name Cell 7 Version 1.4 Serial number 7 Firmware 1.4 Hardware B",
        f"its plain text {DOCUMENT_SHA256}",
        f"{small_list.id} SHA-256 {small_list.sha256}",
        "exhaustive = ",
        "Seed 0",
        "all 20 mutants",
        "Laboratory Lab Operator Li",
        f"File {package.name} SHA-256 {hashlib.sha256(package.read_bytes()).hexdigest()}",
        "Signatory of the file unsigned",
        "Requirements not judged",
        "Signed by Date Signature",
    ):
        assert each in shown, each
    assert re.search(r"Start \d{4}-\d\d-\d\d \d\d:\d\d:\d\d UTC End ", shown)
    assert "Violated requirements" not in shown
    assert '"certification"' not in shown


def test_conformant(certificate: Certificate) -> None:
    """The certificate, also in Chinese, has the unsupported commands and the signatory."""
    results = certificate.results
    subject = replace(results.subject, claims={"lacks": "jog"})
    done = replace(results, verdict=Conclusion.CONFORMANT, subject=subject)
    given = replace(certificate, results=done, signatory="li@lab.example, ED25519 key SHA256:x")
    shown = _Reader(render(given)).text
    assert "Certificate of conformance" in shown
    assert "Conformant Cell 7" in shown
    assert "Unsupported commands jog" in shown
    assert "Signatory of the file li@lab.example, ED25519 key SHA256:x" in shown
    chinese = _Reader(render(given, Language.CHINESE), "zh").text
    assert translate(TEXTS["certificate_title"], Language.CHINESE) in chinese
    assert translate(TEXTS["only_sample"], Language.CHINESE) in chinese


def test_nonconformant(verify: Verify, small_list: MandatoryList, tmp_path: Path) -> None:
    """A genuine package of a nonconformant controller gives a test report with the failures."""
    certified(tmp_path, small_list, mutants()["status-of-one-digit"].wrong)
    path, page = tmp_path / "faulty.scaraspec.zip", tmp_path / "page.html"
    write_package(certification_of(path, small_list), tmp_path, ICS)
    status, text = verify(path, "--certificate", page)
    assert (status, text.splitlines()[-1]) == (1, f"{page}: written")
    shown = _Reader(page.read_text("utf-8")).text
    assert "Test report" in shown
    assert "Nonconformant Cell 7 1.4 At least one" in shown
    assert re.search(r"Violated requirements Requirement Cases Observed .*4\.8/2 ", shown)
    found = verify_package(path, lists=[small_list]).results
    assert found
    assert all(case.id in shown for case in found.cases if case.verdict is Verdict.FAIL)


def test_refused(verify: Verify, package: Path, small_list: MandatoryList, tmp_path: Path) -> None:
    """A package that is refused has no page; here its signature is missing."""
    page, key = tmp_path / "page.html", tmp_path / "key.pub"
    key.write_text("ssh-ed25519 AAAA")
    status, text = verify(package, "--signer", key, "--certificate", page)
    assert status == 1
    assert text.splitlines()[-1] == (
        "no certificate is written about a package that is refused or undecided"
    )
    refused = verify_package(package, lists=[replace(small_list, optional_hooks=())])
    with pytest.raises(PackageError, match="refused or undecided"):
        write_certificate(refused, page)
    assert not page.exists()


def test_nothing_is_overwritten(verify: Verify, package: Path, tmp_path: Path) -> None:
    """The command ends with an error, and the function writes nothing."""
    page = tmp_path / "page.html"
    page.write_text("mine")
    assert verify(package, "--certificate", page) == (
        2,
        f"scaraspec: {page} exists: name another file\n",
    )
    with pytest.raises(FileExistsError):
        write_new(page, "other")
    assert page.read_text() == "mine"
    status, text = verify(package, "--certificate", tmp_path / "missing" / "page.html")
    assert status == 3
    assert "cannot be written: No such file or directory" in text


def test_hostile_text(certificate: Certificate) -> None:
    """Text of the package creates no element, and its control characters are visible."""
    results = certificate.results
    case = replace(
        results.cases[0], id=HOSTILE, requirements=(HOSTILE,), verdict=Verdict.FAIL, message=HOSTILE
    )
    subject = replace(results.subject, name=HOSTILE, version=HOSTILE, claims={"lacks": HOSTILE})
    assert results.run
    run = replace(results.run, settings={HOSTILE: HOSTILE})
    attacked = replace(
        results, cases=(case,), subject=subject, run=run, notices=(HOSTILE,), requirements=()
    )
    page = render(
        replace(
            certificate,
            results=attacked,
            package=HOSTILE,
            mandatory_id=HOSTILE,
            sample=dict.fromkeys(certificate.sample, HOSTILE),
            laboratory=dict.fromkeys(certificate.laboratory, HOSTILE),
            commit=HOSTILE,
            signatory=HOSTILE,
            notes=(HOSTILE,),
        )
    )
    assert page.count("<script>") == 1
    assert not {*"\u202e\x00"} & {*page}
    assert page.count("&lt;script&gt;alert(1)") > 20
    plain = {*_Reader(render(certificate)).tags, "table", "thead", "tbody", "tr", "th", "td"}
    assert _Reader(page).tags <= plain | {"b"}


def test_no_network(certificate: Certificate) -> None:
    """The page loads no resources and has an A4 layout."""
    page = render(certificate)
    assert "default-src 'none'" in page
    assert "http" not in page.replace("http-equiv", "")
    assert "url(" not in page
    assert "size: A4" in page


def test_the_document() -> None:
    """The checksum of the document equals the one in its description."""
    assert DOCUMENT_SHA256 in (ROOT / "spec/README.md").read_text("utf-8")
