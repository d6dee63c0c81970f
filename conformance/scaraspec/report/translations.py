"""The texts of the HTML page in English and Chinese, in one table, so that none is missing.

The table contains only the texts of the tool. Requirements, readings and findings are in English,
with the original text of the document.
"""

from collections.abc import Mapping
from enum import Enum
from types import MappingProxyType
from typing import Final, NamedTuple

from scaraspec.protocol.commands import COMMANDS


class Language(Enum):
    """The language that the page shows first; the page contains both."""

    ENGLISH = "en"
    CHINESE = "zh"


class Translation(NamedTuple):
    """A text in both languages, with replacement fields such as ``{name}``."""

    en: str
    zh: str


TRANSLATIONS: Final[Mapping[str, Translation]] = MappingProxyType(
    {
        "title": Translation("Conformance report", "符合性报告"),
        "protocol": Translation("UISR4200S robot protocol V1.0", "UISR4200S 机器人通信协议 V1.0"),
        "switch": Translation("Language of the page", "页面语言"),
        # Archive
        "archive_title": Translation("Archive report", "归档报告"),
        "both": Translation("both sides", "双方"),
        "calendar": Translation("Verdicts by day", "每日判定"),
        "calendar_means": Translation(
            "The gravest verdict of each robot on each day (UTC).",
            "每台机器人每天（UTC）最严重的判定。",
        ),
        "captures": Translation("Captures", "抓包文件"),
        "earlier_findings": Translation("Earlier findings", "较早的发现"),
        "first_time": Translation("First", "首次"),
        "first_week": Translation("95 %, first week", "95 %，第一周"),
        "last_time": Translation("Last", "最近"),
        "last_week": Translation("95 %, last week", "95 %，最后一周"),
        "latency_by_week": Translation("Latency by week", "每周应答时间"),
        "lost_in_captures": Translation("Bytes not captured", "未捕获的字节"),
        "new_findings": Translation("New kinds of findings since {since}", "{since} 以来的新发现"),
        "none_found": Translation("None.", "无。"),
        "robot": Translation("Robot", "机器人"),
        "robots": Translation("Robots", "机器人"),
        "unreadable": Translation("Not readable", "无法读取"),
        "weeks": Translation("Weeks", "周"),
        # Conclusion
        "conformant": Translation("Conformant", "符合"),
        "no-violation-found": Translation("No violation found", "未发现违规"),
        "no-violation-found_means": Translation(
            "Nothing is violated, but not every requirement in scope was judged.",
            "未发现违规，但并非范围内的所有要求都已判定。",
        ),
        "nonconformant": Translation("Nonconformant", "不符合"),
        "inconclusive": Translation("Inconclusive", "无法判定"),
        "recorded": Translation(
            "No violation found in what was recorded ({missing})",
            "在已记录的内容中未发现违规（{missing}）",
        ),
        "nothing-tested": Translation("Nothing tested", "未作检验"),
        "conformant_means": Translation(
            "Every requirement in scope was judged, and none is violated.",
            "范围内的所有要求均已判定，且无一违反。",
        ),
        "nonconformant_means": Translation(
            "At least one requirement of the document is violated.",
            "至少有一项协议文档的要求被违反。",
        ),
        "inconclusive_means": Translation(
            "No violation was found, but the evidence is not sufficient.",
            "未发现违反之处，但证据不足以下结论。",
        ),
        "nothing-tested_means": Translation(
            "No requirement could be judged. This is not a pass.",
            "没有任何要求得到判定：这不等于通过。",
        ),
        "judged_share": Translation(
            "{judged} of {total} requirements in scope were judged.",
            "范围内共 {total} 项要求，已判定 {judged} 项。",
        ),
        "tried_share": Translation(
            "The cases tried {count} values.", "各用例共尝试 {count} 个取值。"
        ),
        "look_first": Translation("Most important findings", "首先查看"),
        "and_more": Translation("and {count} more", "及另外 {count} 项"),
        "prevented": Translation(
            "not judged because of it: {count}", "因此未能判定的用例：{count} 项"
        ),
        # Verdicts of a case
        "none": Translation("not judged", "未判定"),
        "pass": Translation("pass", "通过"),
        "tolerated": Translation("tolerated", "容许"),
        "inconclusive_case": Translation("inconclusive", "无法判定"),
        "fail": Translation("fail", "失败"),
        "error": Translation("error", "出错"),
        "tolerated_means": Translation(
            "Tolerated: the document is contradictory or silent, and the implementation follows a "
            "listed reading.",
            "容许：协议文档自相矛盾或未作规定，而对方采用了登记在册的一种理解。",
        ),
        # Identity
        "identity": Translation("Identity", "基本信息"),
        "subject": Translation("System under test", "被测对象"),
        "unnamed": Translation("not named", "未命名"),
        "version": Translation("Version", "版本"),
        "link": Translation("Link", "连接"),
        "file": Translation("File", "文件"),
        "role": Translation("Judged as", "判定角色"),
        "claims": Translation(
            "Implementation conformance statement (ICS)", "实现符合性声明（ICS）"
        ),
        "complaints": Translation("Error output of its process", "被测进程的错误输出"),
        "controller": Translation("controller", "控制层"),
        "client": Translation("client", "应用层"),
        "network": Translation("network", "网络"),
        "recording": Translation("recording", "记录"),
        "capture": Translation("capture of both sides", "双方通信的捕获"),
        "period": Translation("Period", "时段"),
        "tool": Translation("Tool", "工具"),
        # Dialect
        "dialect": Translation("Observed dialect", "实际采用的方言"),
        "dialect_means": Translation(
            "How each side interprets the points that the document leaves open.",
            "协议文档未明确之处，双方实际采用的理解如下。",
        ),
        "dialect_none": Translation(
            "The traffic does not show how either side interprets an open point.",
            "线路上未显示对未明确之处的任何理解。",
        ),
        "reading": Translation("Open point", "未明确之处"),
        "claimed": Translation("Claimed", "声明"),
        "default": Translation("default", "默认"),
        "other": Translation("not the default", "非默认"),
        "mixed": Translation("mixed: one side is inconsistent", "混用：同一方前后不一"),
        "not_seen": Translation("not observed", "未观察到"),
        "claim_kept": Translation("as claimed", "与声明一致"),
        "claim_broken": Translation("not as claimed", "与声明不符"),
        # Coverage
        "coverage": Translation("Coverage by clause", "各章节覆盖情况"),
        "coverage_means": Translation(
            "Each square is one requirement in scope.", "每个方格代表范围内的一项要求。"
        ),
        # Cases
        "cases": Translation("Cases", "判定项"),
        "search": Translation("Search  ( / )", "搜索（/）"),
        "filter": Translation("Show by verdict", "按判定筛选"),
        "shown": Translation("shown", "条已显示"),
        "keys": Translation(
            "/ search · j k next and previous · Enter open", "/ 搜索 · j k 上下移动 · Enter 展开"
        ),
        "no_cases": Translation("There are no cases.", "没有判定项。"),
        "requirement": Translation("Requirement", "要求"),
        "original": Translation("Original text of the document", "协议原文"),
        "derived": Translation(
            "derived: it follows from other parts of the document", "推导：由文档其他内容得出"
        ),
        "robustness": Translation("robustness: the document is silent", "健壮性：文档未作规定"),
        "text": Translation("stated by the document", "文档明确规定"),
        "firm": Translation("firm", "强制"),
        "tolerant": Translation("tolerant", "宽容"),
        "info": Translation("observation only", "仅作观察"),
        "register": Translation("Open points", "相关疑点"),
        "expected": Translation("Expected", "应为"),
        "observed": Translation("Observed", "实为"),
        "passing": Translation(
            "A passing exchange of the same command", "同一命令判定通过时的通信"
        ),
        "cause": Translation("Responsible", "责任方"),
        "cause_subject": Translation("the system under test", "被测对象"),
        "cause_set-up": Translation("the test setup", "测试条件"),
        "cause_dependency": Translation("an earlier failure", "先前的失败"),
        "cause_suite": Translation("the test suite", "测试程序"),
        "step": Translation("Failed step", "失败的步骤"),
        "stage_connection": Translation("connection", "连接"),
        "stage_frame": Translation("frame", "帧"),
        "stage_request": Translation("request", "请求"),
        "stage_reply": Translation("first reply", "首次应答"),
        "stage_result": Translation("final result", "最终结果"),
        "step_missing": Translation("missing", "缺失"),
        "step_attempt": Translation("attempt {number}", "第 {number} 次尝试"),
        "step_dependency": Translation(
            "in the preparation of the case: {requirement}", "在用例的准备阶段：{requirement}"
        ),
        "sitting": Translation("Sitting of", "测试场次"),
        "sittings": Translation("Sittings", "各测试场次"),
        "attempts": Translation("Attempts", "各次尝试"),
        "attempt_late": Translation("a message was missing or late", "有报文缺失或迟到"),
        "attempt_stalled": Translation("the tester's machine stalled for", "测试机停顿了"),
        "operator_requests": Translation("Requests to the operator", "对操作员的要求"),
        "operator_done": Translation("done", "已完成"),
        "operator_skipped": Translation("skipped", "已跳过"),
        "verdict_reason": Translation("Reason", "原因"),
        "reason_hazard": Translation("not allowed (--allow)", "未获许可 (--allow)"),
        "reason_undefined-opcodes": Translation(
            "not allowed (--undefined-opcodes)", "未获许可 (--undefined-opcodes)"
        ),
        "reason_slow": Translation("slow (--exhaustive)", "耗时较长 (--exhaustive)"),
        "reason_hook": Translation("a hook is missing in the ICS", "符合性声明缺少钩子"),
        "reason_earlier-session": Translation("completed in an earlier session", "先前已完成"),
        "reason_failed-before": Translation("its requirements failed before", "其要求先前已失败"),
        "reason_fail-fast": Translation("ended by --fail-fast", "因 --fail-fast 提前结束"),
        "reason_not-applicable": Translation("not applicable", "不适用"),
        "reason_too-short": Translation("command too short", "命令过早结束"),
        "reason_dependency": Translation("depends on an earlier failure", "依赖先前的失败"),
        "reason_unreachable": Translation("the subject cannot be used", "被测对象不可用"),
        "reason_withheld": Translation("a motion was withheld", "未发送运动指令"),
        "reason_stalled": Translation("the tester's machine stalled", "测试机停顿"),
        "reason_intermittent": Translation("intermittent", "偶发"),
        "reason_other-client": Translation("another client interfered", "其他客户端干扰"),
        "reason_undecided": Translation("undecided", "无法判定"),
        "reason_interrupted": Translation("interrupted by the user", "用户中断"),
        "reason_coverage": Translation("required coverage not reached", "未达到要求的覆盖率"),
        "reason_not-restored": Translation("not restored", "未恢复原状"),
        "hazard": Translation("Hazard", "危险等级"),
        "hazard_read-only": Translation("read-only", "只读"),
        "hazard_state": Translation("state", "改变状态"),
        "hazard_motion": Translation("motion", "引起运动"),
        "hazard_destructive": Translation("destructive", "破坏性"),
        "took": Translation("Duration", "用时"),
        "examples": Translation("Examples", "取值示例"),
        "evidence": Translation("Evidence", "通信证据"),
        "place": Translation(
            "connection {connection}, byte {offset}, {length} bytes",
            "连接 {connection}，第 {offset} 字节起，共 {length} 字节",
        ),
        "packet": Translation("packet {number}", "第 {number} 包"),
        "whole_frame": Translation("whole frame", "完整帧"),
        "more_bytes": Translation("… {count} more", "……另有 {count} 字节"),
        "replay": Translation("Reproduction command", "重现命令"),
        "steps": Translation("Last steps", "最后步骤"),
        "script": Translation("Script that repeats them", "重复这些步骤的脚本"),
        "moment": Translation("Show this moment", "查看该时刻"),
        "copy": Translation("copy", "复制"),
        "unknown_requirement": Translation(
            "not in this tool's catalogue", "本工具的要求目录中没有此项"
        ),
        # Traffic
        "happened": Translation("Traffic", "通信过程"),
        "no_session": Translation("The results contain no traffic.", "结果中没有通信过程。"),
        "summary_frames": Translation("frames", "帧"),
        "summary_connections": Translation("connections", "连接"),
        "summary_transfers": Translation("transfers", "文件传输"),
        "summary_runs": Translation("program runs", "程序运行"),
        "summary_lost": Translation("gaps in the recording", "记录缺失"),
        "summary_undecodable": Translation("invalid bytes", "不成帧字节"),
        "summary_a2c": Translation("bytes from the client", "应用层发送字节"),
        "summary_c2a": Translation("bytes from the controller", "控制层发送字节"),
        "timeline": Translation("Timeline", "时间线"),
        "lane_connections": Translation("connections", "连接"),
        "lane_transfers": Translation("transfers", "传输"),
        "lane_runs": Translation("program runs", "程序运行"),
        "lane_losses": Translation("gaps", "缺失"),
        "lane_findings": Translation("findings", "判定"),
        "commands": Translation("Command timing", "命令与用时"),
        "commands_means": Translation(
            "Time from the last byte of the request to the first byte of the first reply; → from "
            "the first reply to the final result. The error of the median and the 99th "
            "percentile is at most 2.2 %. Logarithmic scale.",
            "自请求末字节至首次应答首字节；→ 表示其后至最终结果。中位数与第 99 百分位误差"
            "不超过 2.2 %。坐标为对数刻度。",
        ),
        "command": Translation("Command", "命令"),
        "count": Translation("Count", "次数"),
        "refused": Translation("Refused", "拒绝"),
        "unsettled": Translation("Not answered", "未应答"),
        "shortest": Translation("Shortest", "最短"),
        "median": Translation("Median", "中位数"),
        "longest": Translation("Longest", "最长"),
        "transfers": Translation("File transfers", "文件传输"),
        "upload": Translation("upload", "上传"),
        "download": Translation("download", "下载"),
        "name": Translation("Name", "名称"),
        "kind": Translation("Kind", "类别"),
        "begun": Translation("Start", "开始"),
        "duration": Translation("Duration", "历时"),
        "bytes": Translation("Bytes", "字节"),
        "chunks": Translation("Chunks", "数据块"),
        "ended": Translation("Outcome", "结束方式"),
        "state_active": Translation("in progress", "进行中"),
        "state_done": Translation("done", "完成"),
        "state_failed": Translation("failed", "失败"),
        "runs": Translation("Program runs", "程序运行"),
        "outcome_done": Translation("done", "完成"),
        "outcome_failed": Translation("failed", "失败"),
        "outcome_refused": Translation("refused", "被拒绝"),
        "outcome_interrupted": Translation("interrupted by an emergency stop", "被急停打断"),
        "outcome_unanswered": Translation("no reply", "无应答"),
        "outcome_unfinished": Translation("no final result", "无最终结果"),
        "outcome_cut-off": Translation(
            "the recording or the link ended before", "记录或连接先行结束"
        ),
        "outcome_hung-up": Translation(
            "the link was closed without a reply", "对方断开连接而未应答"
        ),
        "outcome_unseen": Translation("hidden by a gap", "因记录缺失未见"),
        "run": Translation("run", "运行"),
        "simulation": Translation("simulation", "模拟"),
        "connections": Translation("Connections", "连接"),
        "ending_open": Translation("open", "未断开"),
        "ending_half-closed": Translation("half-closed", "半关闭"),
        "ending_closed": Translation("closed", "正常关闭"),
        "ending_reset": Translation("reset", "被重置"),
        "frames": Translation("Frames", "帧数"),
        "losses": Translation("Gaps in the recording", "记录缺失"),
        "direction": Translation("Direction", "方向"),
        "A2C": Translation("client → controller", "应用层 → 控制层"),
        "C2A": Translation("controller → client", "控制层 → 应用层"),
        "offset": Translation("Offset", "起始字节"),
        "length_unknown": Translation("unknown", "未知"),
        "reason": Translation("Remark", "说明"),
        "unlisted": Translation("and {count} more", "另有 {count} 项"),
        # Certificate
        "certificate_title": Translation("Certificate of conformance", "符合性证书"),
        "test_report_title": Translation("Test report", "检测报告"),
        "only_sample": Translation(
            "This result relates only to the sample tested.", "本结果仅对受检样品有效。"
        ),
        "serial_number": Translation("Serial number", "序列号"),
        "firmware": Translation("Firmware", "固件"),
        "hardware": Translation("Hardware", "硬件"),
        "unsupported": Translation("Unsupported commands", "不支持的命令"),
        "basis": Translation("Basis of the test", "检测依据"),
        "document": Translation("Protocol document", "协议文档"),
        "document_text": Translation("SHA-256 of its plain text", "其纯文本的 SHA-256"),
        "mandatory": Translation("List of mandatory cases", "必测用例清单"),
        "commit": Translation("Commit", "代码提交"),
        "options": Translation("Options", "选项"),
        "seed": Translation("Seed", "随机种子"),
        "calibration": Translation("Calibration of the tester", "测试工具校准"),
        "calibration_means": Translation(
            "Before the run the reference implementation was conformant, and all {count} mutants "
            "were detected, on the same machine.",
            "运行之前，在同一台机器上，参考实现判定为符合，{count} 个变异体全部检出。",
        ),
        "performed": Translation("Performed", "检测执行"),
        "end": Translation("End", "结束"),
        "laboratory": Translation("Laboratory", "实验室"),
        "operator": Translation("Operator", "操作员"),
        "violated": Translation("Violated requirements", "被违反的要求"),
        "not_judged": Translation("Requirements not judged", "未判定的要求"),
        "package": Translation("Result package", "结果包"),
        "verified_with": Translation("Verified with", "核验工具"),
        "signatory": Translation("Signatory of the file", "文件签署人"),
        "unsigned": Translation("unsigned", "未签名"),
        "signature_unchecked": Translation("signature not checked", "签名未核验"),
        # Signature and footer
        "signature": Translation("Signature", "签署"),
        "signed_by": Translation("Name", "姓名"),
        "signed_on": Translation("Date", "日期"),
        "signed": Translation("Signature", "签名"),
        "precedence": Translation(
            "The document does not mark requirements as mandatory and defines no order of "
            "precedence. This report uses the following order: the frame rule of clause 3, the "
            "prose of a clause, a structure or field definition, the opcode printed in a heading "
            "or row, an example payload, an example length (register, A-0-10).",
            "协议文档未区分强制与否，也未规定内容冲突时以何者为准。本报告依次以下列内容为准："
            "第三章的帧格式、各节正文、结构与字段定义、标题或帧表中的命令字、示例数据、示例长度"
            "（疑点登记 A-0-10）。",
        ),
        "no_safety": Translation(
            "scaraspec is not a safety function, and conformance does not prove safety: keep a "
            "hardware emergency stop within reach.",
            "scaraspec 不是安全功能，符合协议也不证明安全：请务必将硬件急停装置置于伸手可及之处。",
        ),
        "both_languages": Translation(
            "Requirements, readings and findings are in English in both languages; requirements "
            "also show the original text of the document.",
            "要求、理解与判定的语句在两种语言下均为英文；协议原文列于要求旁。",
        ),
    }
)
"""The texts of the page by key."""

CLAUSE_TITLES: Final[Mapping[str, Translation]] = MappingProxyType(
    {
        "2": Translation("Ways of communication", "通信方式"),
        "3": Translation("Frame format", "通信格式"),
        "T": Translation("Text conventions", "文本约定"),
        "4": Translation("Two-stage commands", "两段式命令"),
        **{command.clause: Translation(command.title, command.original) for command in COMMANDS},
        "5.1": Translation("File data structure", "文件数据结构"),
        "5.2": Translation("Upload", "应用层向控制层传输文件"),
        "5.3": Translation("Download", "控制层向应用层传输文件"),
        "5.4": Translation("Duties of the receiver", "接收端数据处理"),
        "6.1": Translation("Program file", "文件格式"),
        "6.2": Translation("File header", "文件头格式"),
        "6.3": Translation("Configuration", "配置信息"),
        "6.4": Translation("User variables", "用户变量"),
        "6.5": Translation("Nodes", "结点格式"),
        "6.6a": Translation("Variable operations", "变量操作"),
        "6.6b": Translation("File footer", "文件尾格式"),
        "7": Translation("Other notes", "其他说明"),
        "8": Translation("Error list", "错误列表"),
    }
)
"""The titles of the clauses."""
