"""Clause 2, transport: TCP, its port, and Bluetooth (L75-83)."""

from scaraspec.judge.requirements.entry import (
    AC,
    AK,
    BOTH,
    CLIENT,
    CONTROLLER,
    DERIVED,
    FIRM,
    INFO,
    MOTION,
    PC,
    READ_ONLY,
    ROBUSTNESS,
    STATE,
    TEXT,
    TOLERANT,
    UNTESTABLE,
    R,
)

# A requirement is one paragraph of a table; the formatter would give it a dozen lines.
# fmt: off
ROWS = (
    R("2/1", lines=(79,), register=("A-2-1",),
      sentence="The client must open the TCP connection; the "
               "controller must be the side that listens.",
      original="控制层作为服务器，应用层以客户端方式连接，两者之间以 tcp 方式建立连接",
      binds=BOTH, testable=AC | AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("2/2", lines=(79,), register=("A-2-1",),
      sentence="A controller on the network must accept TCP connections on port 8877.",
      original="服务器端的接口为 8877",
      binds=CONTROLLER, testable=AC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("2/3", lines=(79,), register=("A-2-1",),
      sentence="A client must dial TCP port 8877 unless its user names another one.",
      original="服务器端的接口为 8877",
      binds=CLIENT, testable=AK | PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("2/4", lines=(79,), register=("A-2-10",),
      sentence="What is sent must be plain, readable data: "
               "neither side encrypts or compresses it.",
      original="传送内容以明文传输",
      binds=BOTH, testable=PC, hazard=READ_ONLY, strength=FIRM, basis=TEXT),
    R("2/5", lines=(79,), register=("A-2-6", "A-3-11"),
      sentence="A frame cut at any byte into several TCP segments, with up to "
               "1 s between the pieces, must be put together again and served.",
      original="两者之间以 tcp 方式建立连接",
      binds=BOTH, testable=AC | AK, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("2/6", lines=(79,), register=("A-2-6",),
      sentence="When one TCP segment brings several frames, every one of them must be served.",
      original="两者之间以 tcp 方式建立连接",
      binds=BOTH, testable=AC | AK, hazard=READ_ONLY, strength=FIRM, basis=DERIVED),
    R("2/7", lines=(81,), register=("A-2-4",),
      sentence="While the network is in use, the controller "
               "is expected to leave Bluetooth unserved.",
      original="使用网络通信时，屏蔽蓝牙通信",
      binds=CONTROLLER, testable=UNTESTABLE, hazard=STATE, strength=INFO, basis=TEXT),
    R("2/8", lines=(81,), register=("A-2-4",),
      sentence="Where network and Bluetooth compete, the network is expected to win.",
      original="网络通信优先级较高",
      binds=CONTROLLER, testable=UNTESTABLE, hazard=STATE, strength=INFO, basis=TEXT),
    R("2/9", lines=(83,), register=("A-2-5",),
      sentence="Over Bluetooth, commands are expected to be served without a login.",
      original="使用蓝牙通信时不需要登录验证。",
      binds=CONTROLLER, testable=UNTESTABLE, hazard=STATE, strength=INFO, basis=TEXT),
    R("2/10", lines=(79, 83, 104), register=("A-4-4",),
      sentence="Over the network a client must log in before it sends any other command.",
      original="使用网络通信时 / 使用蓝牙通信时不需要登录验证。 / 应用层向控制层发送登录验证",
      binds=CLIENT, testable=AK | PC, hazard=STATE, strength=FIRM, basis=DERIVED),
    R("2/11", lines=(83, 104), register=("A-4-4", "A-4.1-1"),
      sentence="A network connection that has not itself logged in must get nothing "
               "done that changes state, moves or destroys; silence, the failure "
               "form and closing all pass, and serving what only reads is tolerated.",
      original="使用蓝牙通信时不需要登录验证。 / 应用层向控制层发送登录验证",
      binds=CONTROLLER, testable=AC | PC, hazard=MOTION, strength=FIRM, basis=DERIVED),
    R("2/12", lines=(79,), register=("A-2-2",),
      sentence="A further client should not disturb the outstanding reply "
               "of a logged-in session; whether the newcomer is cleanly "
               "refused, served beside it or put in its place is reported.",
      original="控制层作为服务器，应用层以客户端方式连接",
      binds=CONTROLLER, testable=AC, hazard=STATE, strength=TOLERANT, basis=DERIVED),
    R("2/13", register=("A-2-7",),
      sentence="Once a client has closed its connection, the controller "
               "must accept the next one, 100 times in a row.",
      binds=CONTROLLER, testable=AC, hazard=READ_ONLY, strength=FIRM, basis=ROBUSTNESS),
)
