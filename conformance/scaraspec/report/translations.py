"""The words of the page, in both languages: one table, so that none is forgotten in one of them.

Only what the tool itself says stands here. Requirements, readings and findings are in English,
the document's own words beside them.
"""

from collections.abc import Mapping
from enum import Enum
from types import MappingProxyType
from typing import Final, NamedTuple

from scaraspec.protocol.commands import COMMANDS


class Language(Enum):
    """What a reader of the page prefers; the page itself holds both."""

    ENGLISH = "en"
    CHINESE = "zh"


class Words(NamedTuple):
    """The same in both languages; ``{name}`` is filled in."""

    en: str
    zh: str


WORDS: Final[Mapping[str, Words]] = MappingProxyType(
    {
        "title": Words("Conformance report", "符合性报告"),
        "protocol": Words("UISR4200S robot protocol V1.0", "UISR4200S 机器人通信协议 V1.0"),
        "switch": Words("Language of the page", "页面语言"),
        # What it amounts to
        "conformant": Words("Conformant", "符合"),
        "nonconformant": Words("Nonconformant", "不符合"),
        "inconclusive": Words("Inconclusive", "无法判定"),
        "nothing-tested": Words("Nothing tested", "未作检验"),
        "conformant_means": Words(
            "Nothing that was judged violates the document.", "所判定的内容均未违反协议文档。"
        ),
        "nonconformant_means": Words(
            "At least one requirement of the document is violated.",
            "至少有一项协议文档的要求被违反。",
        ),
        "inconclusive_means": Words(
            "No violation was found, but the evidence does not suffice.",
            "未发现违反之处，但证据不足以下结论。",
        ),
        "nothing-tested_means": Words(
            "No requirement could be judged: this is no pass.",
            "没有任何要求得到判定：这不等于通过。",
        ),
        "judged_share": Words(
            "{judged} of {total} requirements in scope were judged.",
            "范围内共 {total} 项要求，已判定 {judged} 项。",
        ),
        "tried_share": Words(
            "The cases were tried for {count} values.", "各用例共试过 {count} 个取值。"
        ),
        "look_first": Words("To be looked at first", "首先查看"),
        "and_more": Words("and {count} more", "及另外 {count} 项"),
        # Verdicts of a case
        "none": Words("not judged", "未判定"),
        "pass": Words("pass", "通过"),
        "tolerated": Words("tolerated", "容许"),
        "inconclusive_case": Words("inconclusive", "无法判定"),
        "fail": Words("fail", "失败"),
        "error": Words("error", "出错"),
        "tolerated_means": Words(
            "Tolerated: the document contradicts itself or is silent, and a listed reading is "
            "followed.",
            "容许：协议文档自相矛盾或未作规定，而对方采用了登记在册的一种理解。",
        ),
        # Identity
        "identity": Words("Identity", "被测对象"),
        "subject": Words("Subject", "对象"),
        "unnamed": Words("not named", "未命名"),
        "version": Words("Version", "版本"),
        "link": Words("Link", "连接"),
        "file": Words("File", "文件"),
        "role": Words("Judged as", "判定角色"),
        "claims": Words("Statement of conformance (ICS)", "实现符合性声明（ICS）"),
        "complaints": Words("What its process complained of", "被测进程的错误输出"),
        "controller": Words("controller", "控制层"),
        "client": Words("client", "应用层"),
        "capture": Words("capture of both sides", "双方通信的捕获"),
        "period": Words("Period", "时段"),
        "tool": Words("Tool", "工具"),
        # Dialect
        "dialect": Words("Dialect found", "所见方言"),
        "dialect_means": Words(
            "Where the document leaves a point open, this is how each side settles it.",
            "协议文档未明确之处，双方实际采用的理解如下。",
        ),
        "dialect_none": Words(
            "Nothing on the wire showed how an open point is settled.",
            "线路上未显示对未明确之处的任何理解。",
        ),
        "reading": Words("Open point", "未明确之处"),
        "claimed": Words("Claimed", "声明"),
        "default": Words("default", "默认"),
        "other": Words("other than the default", "非默认"),
        "mixed": Words("mixed: one side contradicts itself", "混用：同一方前后不一"),
        "not_seen": Words("not seen", "未见"),
        "claim_kept": Words("as claimed", "与声明一致"),
        "claim_broken": Words("not as claimed", "与声明不符"),
        # Coverage
        "coverage": Words("Coverage by clause", "各章节覆盖情况"),
        "coverage_means": Words(
            "One square is one requirement in scope.", "每个方格代表范围内的一项要求。"
        ),
        # Cases
        "cases": Words("Cases", "判定项"),
        "search": Words("Search  ( / )", "搜索（/）"),
        "filter": Words("Show by verdict", "按判定筛选"),
        "shown": Words("shown", "条显示"),
        "keys": Words(
            "/ search · j k next and previous · Enter unfold", "/ 搜索 · j k 上下移动 · Enter 展开"
        ),
        "no_cases": Words("There are no cases.", "没有判定项。"),
        "requirement": Words("Requirement", "要求"),
        "original": Words("The document's words", "协议原文"),
        "derived": Words(
            "derived: it follows from the rest of the document", "推导：由文档其他内容得出"
        ),
        "robustness": Words("robustness: the document is silent", "健壮性：文档未作规定"),
        "text": Words("stated by the document", "文档明确规定"),
        "firm": Words("firm", "强制"),
        "tolerant": Words("tolerant", "宽容"),
        "info": Words("observation only", "仅作观察"),
        "register": Words("Open points", "相关疑点"),
        "expected": Words("Expected", "应为"),
        "observed": Words("Observed", "实为"),
        "passing": Words("The same command when it was right", "同一命令正确时的情形"),
        "cause": Words("Responsible", "责任方"),
        "cause_subject": Words("the subject", "被测对象"),
        "cause_set-up": Words("the set-up", "测试条件"),
        "cause_dependency": Words("an earlier failure", "先前的失败"),
        "cause_suite": Words("the suite", "测试程序"),
        "hazard": Words("Hazard", "危险等级"),
        "hazard_read-only": Words("read-only", "只读"),
        "hazard_state": Words("state", "改变状态"),
        "hazard_motion": Words("motion", "引起运动"),
        "hazard_destructive": Words("destructive", "破坏性"),
        "took": Words("Took", "用时"),
        "examples": Words("Examples", "取值示例"),
        "evidence": Words("On the wire", "线路证据"),
        "place": Words(
            "connection {connection}, byte {offset}, {length} bytes",
            "连接 {connection}，第 {offset} 字节起，共 {length} 字节",
        ),
        "whole_frame": Words("whole frame", "完整帧"),
        "more_bytes": Words("… {count} more", "……另有 {count} 字节"),
        "replay": Words("Show it again", "重现命令"),
        "moment": Words("Look at the moment", "查看该时刻"),
        "copy": Words("copy", "复制"),
        "unknown_requirement": Words("not in this tool's catalogue", "本工具的要求目录中没有此项"),
        # What happened
        "happened": Words("What happened", "通信经过"),
        "no_session": Words("The results do not say what happened.", "结果中没有通信经过。"),
        "summary_frames": Words("frames", "帧"),
        "summary_connections": Words("connections", "连接"),
        "summary_transfers": Words("transfers", "文件传输"),
        "summary_runs": Words("program runs", "程序运行"),
        "summary_lost": Words("gaps in the recording", "记录缺失"),
        "summary_undecodable": Words("bytes that are no frame", "不成帧字节"),
        "summary_a2c": Words("bytes from the client", "应用层发送字节"),
        "summary_c2a": Words("bytes from the controller", "控制层发送字节"),
        "timeline": Words("Course of the session", "会话过程"),
        "lane_connections": Words("connections", "连接"),
        "lane_transfers": Words("transfers", "传输"),
        "lane_runs": Words("program runs", "程序运行"),
        "lane_losses": Words("gaps", "缺失"),
        "lane_findings": Words("findings", "判定"),
        "commands": Words("Commands and their timing", "命令与用时"),
        "commands_means": Words(
            "From the request's last byte to the first reply's first; → from there to the final "
            "result. Median and 99th percentile within 2.2 %. The scale is logarithmic.",
            "自请求末字节至首次应答首字节；→ 表示其后至最终结果。中位数与第 99 百分位误差"
            "不超过 2.2 %。坐标为对数刻度。",
        ),
        "command": Words("Command", "命令"),
        "count": Words("Count", "次数"),
        "refused": Words("Refused", "拒绝"),
        "unsettled": Words("Not answered", "未应答"),
        "shortest": Words("Shortest", "最短"),
        "median": Words("Median", "中位数"),
        "longest": Words("Longest", "最长"),
        "transfers": Words("File transfers", "文件传输"),
        "upload": Words("upload", "上传"),
        "download": Words("download", "下载"),
        "name": Words("Name", "名称"),
        "kind": Words("Kind", "类别"),
        "begun": Words("Begun", "开始"),
        "duration": Words("Duration", "历时"),
        "bytes": Words("Bytes", "字节"),
        "chunks": Words("Chunks", "数据块"),
        "ended": Words("Ended", "结束方式"),
        "state_active": Words("under way", "进行中"),
        "state_done": Words("done", "完成"),
        "state_failed": Words("failed", "失败"),
        "runs": Words("Program runs", "程序运行"),
        "outcome_done": Words("done", "完成"),
        "outcome_failed": Words("failed", "失败"),
        "outcome_refused": Words("refused", "被拒绝"),
        "outcome_interrupted": Words("interrupted by an emergency stop", "被急停打断"),
        "outcome_unanswered": Words("no reply", "无应答"),
        "outcome_unfinished": Words("no final result", "无最终结果"),
        "outcome_cut-off": Words("the recording or the link ended first", "记录或连接先行结束"),
        "outcome_hung-up": Words("the link was closed instead", "对方断开连接而未应答"),
        "outcome_unseen": Words("hidden by a gap", "因记录缺失未见"),
        "run": Words("run", "运行"),
        "simulation": Words("simulation", "模拟"),
        "connections": Words("Connections", "连接"),
        "ending_open": Words("open", "未断开"),
        "ending_half-closed": Words("half-closed", "半关闭"),
        "ending_closed": Words("closed", "正常关闭"),
        "ending_reset": Words("reset", "被重置"),
        "frames": Words("Frames", "帧数"),
        "losses": Words("Gaps in the recording", "记录缺失"),
        "direction": Words("Direction", "方向"),
        "A2C": Words("client → controller", "应用层 → 控制层"),
        "C2A": Words("controller → client", "控制层 → 应用层"),
        "offset": Words("At byte", "起始字节"),
        "length_unknown": Words("unknown", "未知"),
        "reason": Words("Remark", "说明"),
        "unlisted": Words("and {count} more", "另有 {count} 项"),
        # Signature and foot
        "signature": Words("Signature", "签署"),
        "signed_by": Words("Name", "姓名"),
        "signed_on": Words("Date", "日期"),
        "signed": Words("Signature", "签名"),
        "precedence": Words(
            "The document marks nothing as mandatory and names no order of precedence. This report "
            "takes: the frame rule of clause 3, before the prose of a clause, before a structure "
            "or field definition, before the opcode printed in a heading or row, before an example "
            "payload, before an example length (register, A-0-10).",
            "协议文档未区分强制与否，也未规定内容冲突时以何者为准。本报告依次以下列内容为准："
            "第三章的帧格式、各节正文、结构与字段定义、标题或帧表中的命令字、示例数据、示例长度"
            "（疑点登记 A-0-10）。",
        ),
        "no_safety": Words(
            "scaraspec is no safety function, and conformance is no proof of safety: keep a "
            "hardware emergency stop within reach.",
            "scaraspec 不是安全功能，符合协议也不证明安全：请务必将硬件急停装置置于伸手可及之处。",
        ),
        "both_languages": Words(
            "Sentences of requirements, readings and findings are English in both languages; the "
            "document's own words stand beside the requirements.",
            "要求、理解与判定的语句在两种语言下均为英文；协议原文列于要求旁。",
        ),
    }
)
"""Every word of the page by its key."""

CLAUSES: Final[Mapping[str, Words]] = MappingProxyType(
    {
        "2": Words("Ways of communication", "通信方式"),
        "3": Words("Frame format", "通信格式"),
        "T": Words("Text conventions", "文本约定"),
        "4": Words("Two-stage commands", "两段式命令"),
        **{command.clause: Words(command.title, command.original) for command in COMMANDS},
        "5.1": Words("File data structure", "文件数据结构"),
        "5.2": Words("Upload", "应用层向控制层传输文件"),
        "5.3": Words("Download", "控制层向应用层传输文件"),
        "5.4": Words("Duties of the receiver", "接收端数据处理"),
        "6.1": Words("Program file", "文件格式"),
        "6.2": Words("File header", "文件头格式"),
        "6.3": Words("Configuration", "配置信息"),
        "6.4": Words("User variables", "用户变量"),
        "6.5": Words("Nodes", "结点格式"),
        "6.6a": Words("Variable operations", "变量操作"),
        "6.6b": Words("File footer", "文件尾格式"),
        "7": Words("Other notes", "其他说明"),
        "8": Words("Error list", "错误列表"),
    }
)
"""The clauses' headings."""
