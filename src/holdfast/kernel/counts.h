/* Counts of a sensor, parsed from the two forms that a packet of XELA's server has of them. */
#ifndef HF_COUNTS_H
#define HF_COUNTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Parse counts in the forms that the server writes. Return false for any other form, which Python
 * then parses, to accept it or to name the mistake.
 *
 * text: a JSON string of numbers of four hexadecimal digits, with commas between them.
 * list: a JSON list of the same whole numbers, or null.
 * counts: (n_text / 5) is filled.
 */
bool holdfast_parse_counts(
    const char *text, size_t n_text, const char *list, size_t n_list, uint16_t *counts);

#endif
