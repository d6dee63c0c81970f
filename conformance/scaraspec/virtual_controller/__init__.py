"""The virtual controller: a conforming controller with a simulated robot.

Belongs here: the core (protocol, sessions), the behaviour of each command, the simulated robot
(plant, arm, motion, interpreter, store), and the server that connects the core to TCP, a serial
port and a clock. Only the server, the serial port, the console and the store do I/O.

Does not belong here: deliberate faults (see `mutants`), and the suite, which must not import this
package.
"""
