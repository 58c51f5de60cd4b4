#include "old_spellings.h"

#include <algorithm>
#include <array>

#include "numbered_pictures.h"

namespace unseen::app {
namespace {

using Words = std::vector<std::string>;

// "--path X" or "--path=X".
Words::iterator find(Words& words, const std::string& option) {
    return std::ranges::find_if(
        words, [&](const std::string& word) { return word == option || word.starts_with(option + "="); });
}

// What options are called today, and what stands before their value: "--gaze-error 0.5" is "--tracker error=0.5".
struct Renamed {
    std::string before, now, value;
    bool is_flag = false;

    std::string joined() const { return now + "=" + value; }
};

void rename_options(Words& words) {
    std::vector<Renamed> renamed = {{"--gaze-trace", "--gaze-mode", ""},
                                    {"--gaze-error", "--tracker", "error="},
                                    {"--gaze-latency", "--tracker", "latency="},
                                    {"--suppression", "--tracker", "suppression", true}};
    if (std::ranges::count(std::array{"simplify", "render", "fly", "view"}, words[0]))
        renamed.push_back({"--threshold", "--quality", ""});
    if (words[0] == "fly" || words[0] == "view") renamed.push_back({"--seed", "--tracker", "seed="});
    for (const Renamed& r : renamed)
        for (auto word = words.begin(); word != words.end(); ++word) {
            if (word->starts_with(r.before + "=")) word->replace(0, r.before.size() + 1, r.joined());
            else if (*word == r.before && r.is_flag) *word = r.joined();
            else if (*word == r.before && word + 1 != words.end()) *word = r.now, (word + 1)->insert(0, r.value);
        }
}

// The method, which is taken out: "tree" means cuts.
std::string take_method(Words& words) {
    const auto at = find(words, "--method");
    if (at == words.end()) return {};
    const std::size_t equals = at->find('=');
    const std::string method = equals != std::string::npos ? at->substr(equals + 1)
                               : at + 1 != words.end()     ? *(at + 1)
                                                           : std::string();
    if (method == "tree") words.erase(at, std::min(words.end(), at + (equals == std::string::npos ? 2 : 1)));
    return method;
}

void renew_render(Words& words) {
    const std::string method = take_method(words);
    const bool is_numbered =
        find(words, "--show") == words.end() &&
        std::ranges::any_of(words, [](const std::string& word) { return parse_pattern(word).has_value(); });
    if (!method.empty() && method != "tree") words[0] = "levels";
    else if (find(words, "--path") != words.end() || is_numbered) words[0] = "fly";
}

} // namespace

void renew_spelling(Words& all) {
    const auto verb = std::ranges::find_if_not(all, [](const std::string& word) { return word.starts_with("-"); });
    if (verb == all.end()) return;
    Words words(verb, all.end());
    if (words[0] == "render") renew_render(words);
    else if (words[0] == "select") words[0] = "levels";
    else if (words[0] == "scene" && words.size() > 1 && words[1] == "make") std::swap(words[0], words[1]);
    rename_options(words);
    all.erase(verb, all.end());
    all.insert(all.end(), words.begin(), words.end());
}

} // namespace unseen::app
