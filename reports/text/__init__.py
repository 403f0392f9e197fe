"""Results as text: page one in a terminal, and the generated parts of the documents."""
