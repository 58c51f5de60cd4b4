#include <unseen/perception/csf.h>

#include <cassert>
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

std::shared_ptr<const CsfTable> csf_of(const Person& person) {
    const auto made = [](double gain) {
        Result<CsfTable> table = CsfTable::standard().scaled(gain);
        assert(table && "the gain is in its range");
        return std::make_shared<const CsfTable>(*std::move(table));
    };
    static const auto median = made(median_person.gain), usual = made(default_person.gain),
                      strict = made(strict_person.gain);
    for (const auto& [known, table] :
         {std::pair{median_person, median}, {default_person, usual}, {strict_person, strict}})
        if (person.gain == known.gain) return table;
    return made(person.gain);
}

} // namespace unseen::perception
