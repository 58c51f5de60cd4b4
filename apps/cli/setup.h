// The setup of a command: where one looks from, on what display, under what light, and how files are read. Its options
// are those of the whole program; each verb names the parts that act in it. `unseen help setup` documents them.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "options.h"

namespace unseen::app {

class Setup {
public:
    enum Part : unsigned {
        view = 1,
        parallel = 2, // --orthographic
        display = 4,  // the screen
        observer = 8, // --observer
        csf = 16,     // --csf
        light = 32,   // lights, background, unit
        files = 64,   // how meshes are read
        skip_bad = 128,
        cache = 256,                                                         // --no-cache
        scenes = 512,                                                        // --as: the verb takes scenes
        two_eyes = 1024,                                                     // --eyes
        model = display | observer | csf | light | files | skip_bad | cache, // of all verbs that look at a model
    };

    // Adds the options to the program. It must outlive the parser.
    explicit Setup(CLI::App& program);
    Setup(const Setup&) = delete;
    Setup& operator=(const Setup&) = delete;

    ViewOptions& view_options() { return view_; }
    DisplayOptions& display_options() { return display_; }

    // The verb takes these parts, a sum of Part.
    void act_in(CLI::App& verb, unsigned parts);
    // The first names of the options that act in the verb, or of all; those of the file alone excepted.
    std::vector<std::string> names_in(const CLI::App& verb) const { return names_in(parts_of(verb)); }
    std::vector<std::string> names() const { return names_in(~0U); }
    // A line for each part that acts in the verb, for its help; empty: none does.
    std::string summary_of(const CLI::App& verb) const;
    // All of it, for `help setup`.
    std::string help() const;

    // After the parse: ends it where an option is given that does not act in the verb, or options contradict each other.
    void check(const CLI::App& verb);

private:
    struct Section {
        CLI::App* group = nullptr;
        std::string name; // in summary_of()
    };
    CLI::App& add_section(const std::string& name, const std::string& about);
    void add_view();
    void add_display();
    void add_light();
    void add_files();
    void mark(CLI::App& section, unsigned part); // what is there and has no mark
    void read_file(const std::string& file);
    void take(const std::string& file, const std::string& key, CLI::Option& option,
              const std::vector<std::string>& words);
    unsigned parts_of(const CLI::App& verb) const;
    std::vector<std::string> names_in(unsigned parts) const;

    CLI::App& program_;
    ViewOptions view_;
    DisplayOptions display_;
    std::vector<Section> sections_;
    std::vector<std::pair<CLI::Option*, unsigned>> options_;
    std::map<const CLI::App*, unsigned> verbs_;
};

} // namespace unseen::app
