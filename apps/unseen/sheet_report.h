// What a contact sheet shows, as numbers.
#pragma once

#include <vector>

#include "contact_sheet.h"
#include "report.h"

namespace unseen::app {

Json sheet_json(const std::vector<SheetCut>& cuts);
void print_sheet(const std::vector<SheetCut>& cuts);         // a table
void print_sheet_effects(const std::vector<SheetCut>& cuts); // what took part in each

} // namespace unseen::app
