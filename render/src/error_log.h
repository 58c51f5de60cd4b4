// Collects what GL reports as an error: debug messages and error flags.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace unseen::render {

class ErrorLog {
public:
    // Routes the current context's debug output here. The log must outlive the context and stay where it is.
    void attach();

    // From here on, new errors are told apart from earlier ones, which stay in the log for take_all().
    void begin();

    // Takes out the errors since begin(), joined by "; ", empty if there were none.
    std::string take_new();

    // Takes out everything.
    std::string take_all();

    void add(std::string message);

private:
    struct Messages {
        std::vector<std::string> texts;
        std::size_t left_out = 0;

        void add(std::string text);
        std::string take();
    };

    void collect_flags();

    Messages earlier_;
    Messages recent_;
    bool flag_told_ = false; // a debug message arrived since the flags were read, so they need not be told again
};

} // namespace unseen::render
