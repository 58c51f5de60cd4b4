#include <perception/person.h>

#include <string>

namespace unseen::perception {

Result<Person> person(std::string_view wanted) {
    std::string names;
    for (const Person& p : people) {
        if (p.name == wanted) return p;
        names += (names.empty() ? "" : ", ") + std::string(p.name);
    }
    return Error{ErrorCode::invalid_argument,
                 "'" + std::string(wanted) + "' is no observer; there are: " + names + "."};
}

} // namespace unseen::perception
