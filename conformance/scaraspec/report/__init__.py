"""Reports: the results of a run or an audit in formats for users and for programs.

`model` defines results.json; all other formats are derived from it and add no verdicts. This
package opens no links. Text from the system under test is untrusted until a writer sanitizes it.
"""
