// Command lines that were valid once.
#pragma once

#include <string>
#include <vector>

namespace unseen::app {

// Replaces the words of verbs that have been divided or renamed: `render --path` is `fly`, `render --method` and `select`
// are `levels`, `scene make` is `make scene`. And those of options that became values of others: `--gaze-error 0.5` is
// `--tracker error=0.5`. Today's words stay as they are.
void renew_spelling(std::vector<std::string>& words);

} // namespace unseen::app
